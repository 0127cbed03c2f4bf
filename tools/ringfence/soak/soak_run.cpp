#include "soak/soak_run.hpp"

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <malloc.h>

#include "exit_code.hpp"
#include "figures.hpp"
#include "frame_checker.hpp"
#include "progress.hpp"
#include "ringfence/error.hpp"
#include "run_options.hpp"
#include "soak/soak.hpp"
#include "stop_signals.hpp"

namespace ringfence::tools {
namespace {

constexpr std::uint32_t frames_per_check = 16;  // one frame in 16 is compared with brute force
constexpr double default_deadline_ms = 250;
constexpr std::size_t spawns_in_window = 40;  // of a user, so that the soak can exceed it

/// Bytes that the process has allocated; 0 under sanitizers, which have their own allocator.
std::uint64_t allocated_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

double mebibytes(std::uint64_t bytes) { return static_cast<double>(bytes) / (1 << 20); }

class SoakRun {
 public:
  SoakRun(const Job& job, std::uint64_t seed, const FrameObserver& observe, const FrameObserver& restored)
      : is_observed_(observe != nullptr),
        job_(soak_job(job)),
        journal_(job_, figures_, observe),
        world_(journal_.make_world(soak_config(job_))),
        checker_(world_, job_.output.check) {
    if (restored) restored(world_.frames(), figures_.digest());
    run_frame();  // objects of the scene come into the world, or requests that were saved are applied
    soak_.emplace(world_, job_.scene, seed);
  }

  int run(double minutes) {
    const StopSignals stop;
    constexpr std::uint64_t steps = 1000;
    Progress progress(job_.output.quiet, steps);
    std::uint64_t shown = 0;
    double share = 0;
    // A process that may be killed ends with the first failure, so that it is not lost.
    for (; share < 1 && !stop.received() && (passed() || !is_observed_); share = elapsed_minutes() / minutes) {
      if (!settled_bytes_ && share > 0.1) settled_bytes_ = allocated_with_all_nodes();
      check_one_frame();
      for (; shown < static_cast<std::uint64_t>(share * steps); ++shown) progress.step();
    }
    progress.finish();
    const double done_minutes = std::min(share, 1.0) * minutes;
    const char* const ended_by = share < 1 ? stop.received() : nullptr;
    const std::uint64_t bytes = allocated_with_all_nodes();
    journal_.finish();
    return report(fmt::format("{:.1f} minutes{}", done_minutes,
                              ended_by ? fmt::format(" of {:.1f}: ended by {}", minutes, ended_by) : ""),
                  bytes, ended_by != nullptr);
  }

 private:
  using Clock = std::chrono::steady_clock;

  bool passed() const { return soak_->counts().failures == 0 && checker_.passed(); }
  double elapsed_minutes() const { return std::chrono::duration<double>(Clock::now() - begin_).count() / 60; }

  /// One frame that is not compared with brute force.
  void run_frame() {
    advance(world_, world_.frames());
    journal_.count_frame(world_);
    checker_.skip_frame();
    if (soak_) soak_->note_late_users(world_.report());
  }

  void check_one_frame() {
    soak_->make_requests();
    advance(world_, world_.frames());
    journal_.count_frame(world_);
    soak_->check_report(world_.report());
    ++frames_;
    contacts_ += world_.contacts().size();
    slowest_ms_ = std::max(slowest_ms_, world_.report().frame_ms);
    if (world_.frames() % frames_per_check == 0) {
      checker_.check_frame(world_.frames());
    } else {
      checker_.skip_frame();
    }
  }

  /// Bytes that are allocated with the number of CD nodes of the job, so that two values can be compared.
  std::uint64_t allocated_with_all_nodes() {
    world_.release_faults();
    // An injected failure to create a thread occurs once.
    const std::uint32_t nodes = job_.service.nodes;
    Status status = nodes == 0 ? Status::ok : world_.resize(nodes);
    if (status == Status::no_thread) status = world_.resize(nodes);
    if (status != Status::ok) throw Error(fmt::format("--soak: resize returned {}", name_of(status)));
    for (int i = 0; i < 4; ++i) run_frame();
    return allocated_bytes();
  }

  int report(const std::string& time, std::uint64_t bytes, bool is_ended) {
    const std::uint64_t settled = settled_bytes_.value_or(0);
    const bool memory_is_stable = settled == 0 || bytes < settled + settled / 4;
    const Soak::Counts& n = soak_->counts();
    fmt::print("{}\nsoak        {}, {} frames, {} contacts; the slowest frame took {:.1f} ms\n", job_.title, time,
               frames_, contacts_, slowest_ms_);
    fmt::print("objects     {} spawned, {} destroyed, {} placed, {} disabled, {} enabled, {} changed; {} at the end\n",
               n.spawned, n.destroyed, n.placed, n.disabled, n.enabled, n.changed, world_.report().objects);
    fmt::print("user nodes  {} connected, {} disconnected, {} late, {} inputs; {} shapes registered, {} removed\n",
               n.connected, n.disconnected, n.late, n.inputs, n.shapes, n.shapes_removed);
    fmt::print("CD nodes    {} resizes, {} failures injected, {} nodes lost; {} at the end\n", n.resizes, n.faults,
               n.lost, world_.nodes());
    fmt::print("stopped     {} nodes released inside a stage; {} times no thread for a new node\n", n.released,
               n.without_thread);
    fmt::print("refused     {} invalid calls, each counted by its reason; {} times a user exceeded its quota\n",
               n.refused, n.floods);
    if (job_.output.check) {
      fmt::print("check       {} frames compared with brute force, {} differences\n", checker_.frames(),
                 checker_.differences());
    }
    fmt::print("memory      {:.1f} MiB allocated after a tenth of the time, {:.1f} at the end\n", mebibytes(settled),
               mebibytes(bytes));
    const bool all_passed = passed() && memory_is_stable;
    fmt::print("{}\n", all_passed ? "all checks passed"
                                  : fmt::format("FAILED: {} frames or calls failed a check{}", n.failures,
                                                memory_is_stable ? "" : "; memory has grown by more than a quarter"));
    if (!all_passed) return check_failed;
    return is_ended ? incomplete : done;
  }

  bool is_observed_;
  Job job_;
  Figures figures_;
  JournalRun journal_;
  World world_;
  FrameChecker checker_;
  std::optional<Soak> soak_;
  Clock::time_point begin_ = Clock::now();
  std::optional<std::uint64_t> settled_bytes_;
  std::uint64_t frames_ = 0, contacts_ = 0;
  double slowest_ms_ = 0;
};

}  // namespace

Job soak_job(Job job) {
  if (job.service.deadlines.node_ms == 0) job.service.deadlines.node_ms = default_deadline_ms;
  if (job.service.deadlines.user_ms == 0) job.service.deadlines.user_ms = 2 * default_deadline_ms;
  job.frames.warmup = 0;
  job.frames.frames = max_frames;
  return job;
}

WorldConfig soak_config(const Job& job) {
  WorldConfig config = world_config(job);
  config.log = nullptr;  // nodes are lost on purpose
  config.quotas = {};
  config.quotas.spawns = spawns_in_window;
  return config;
}

int run_soak(const Job& job, double minutes, std::uint64_t seed, const FrameObserver& observe,
             const FrameObserver& restored) {
  return SoakRun(job, seed, observe, restored).run(minutes);
}

}  // namespace ringfence::tools
