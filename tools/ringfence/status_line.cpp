#include "status_line.hpp"

#include <algorithm>
#include <cstdio>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "exit_code.hpp"
#include "metrics_option.hpp"
#include "output_file.hpp"
#include "report.hpp"

namespace ringfence::tools {

namespace {

using Clock = std::chrono::steady_clock;

}  // namespace

StatusLine::StatusLine(const Job& job, const World& world, const NodeProcesses* node_processes, Progress& progress)
    : job_(job),
      world_(world),
      node_processes_(node_processes),
      progress_(progress),
      metrics_(open_metrics(job.output.metrics)),
      last_update_(Clock::now()) {
  if (!job_.output.status.empty()) write(false);
}

void StatusLine::step() {
  progress_.step();
  if (node_processes_ == nullptr && job_.output.status.empty() && metrics_ == nullptr) return;
  const auto now = Clock::now();
  if (now < next_) return;
  next_ = now + std::chrono::seconds(1);
  update(false);
}

void StatusLine::finish(const char* ended_by) {
  ended_by_ = ended_by;
  progress_.finish();
  if (!job_.output.status.empty()) update(true);
}

void StatusLine::update(bool last) {
  if (node_processes_ != nullptr) {
    const dds::ClusterReport cluster = node_processes_->report();
    const auto now = Clock::now();
    const double seconds = std::chrono::duration<double>(now - last_update_).count();
    std::uint64_t bytes = 0;
    double slowest = 0;
    for (const dds::MemberReport& member : cluster.members) {
      bytes += member.sent_bytes + member.received_bytes;
      slowest = std::max(slowest, member.answer_ms_max);
    }
    const double rate = bytes > last_bytes_ ? static_cast<double>(bytes - last_bytes_) * 1e-6 / seconds : 0;
    progress_.set_text(
        fmt::format("frame {}: {} nodes, {} lost, {:.0f} frames/s, {:.1f} MB/s, slowest answer {:.1f} ms",
                    world_.frames(), cluster.members.size(), cluster.lost,
                    static_cast<double>(world_.frames() - last_frames_) / seconds, rate, slowest));
    last_bytes_ = bytes;
    last_frames_ = world_.frames();
    last_update_ = now;
  }
  if (metrics_ != nullptr) metrics_->set(world_);
  if (!job_.output.status.empty()) write(last);
}

// Writes to a temporary name and renames it, so that readers never see an incomplete file.
void StatusLine::write(bool last) const {
  nlohmann::ordered_json status = {{"frame", world_.frames()},
                                   {"frames", std::uint64_t{job_.frames.warmup} + job_.frames.frames},
                                   {"done", last},
                                   {"ended_by", ended_by_ ? nlohmann::ordered_json(ended_by_) : nullptr},
                                   {"nodes", world_.nodes()},
                                   {"frame_ms", world_.report().frame_ms},
                                   {"contacts", world_.report().contacts},
                                   {"objects", world_.report().objects}};
  if (node_processes_ != nullptr) status["cluster"] = cluster_json(node_processes_->report());
  const std::string part = job_.output.status + ".part";
  OutputFile file(part);
  file.print("{}\n", status.dump(1, ' '));
  file.close();
  if (std::rename(part.c_str(), job_.output.status.c_str()) != 0) {
    throw IncompleteError(fmt::format("{} cannot be written", job_.output.status));
  }
}

}  // namespace ringfence::tools
