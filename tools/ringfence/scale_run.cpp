#include "scale_run.hpp"

#include <algorithm>

#include "figures.hpp"
#include "frame_checker.hpp"
#include "medians.hpp"
#include "path_samples.hpp"
#include "worlds/load.hpp"

namespace ringfence::tools {
namespace {

/// One value per frame, for medians. Times in milliseconds.
struct FrameSamples {
  std::vector<double> wall, server, node, users, path;
  PathSamples steps;
  double busiest_tested = 0;

  void add(const FrameReport& report, std::uint32_t node_threads) {
    wall.push_back(report.frame_ms);
    server.push_back(report.server_cpu_ms);
    double busiest = 0;
    std::uint64_t tested = 0;
    for (const NodeReport& each : report.nodes) {
      busiest = std::max(busiest, each.cpu_ms);
      tested = std::max(tested, each.tested);
    }
    busiest_tested += static_cast<double>(tested);
    // Without threads of their own, the CPU time of nodes and users is included in that of the server's thread.
    const bool threads = node_threads > 0;
    node.push_back(threads ? busiest : 0);
    users.push_back(threads ? report.slowest_user_cpu_ms : 0);
    path.push_back(threads ? report.path.critical_ms() : server.back());
    steps.add(report);
  }
};

FrameCounts counts_of(const Job& job, const Figures& figures, double busiest_tested) {
  FrameCounts counts;
  counts.objects = static_cast<double>(job.scene.objects.size());
  counts.users = job.service.users;
  counts.nodes = std::max(1u, job.service.nodes);
  double movable = 0, avatars = 0;
  for (const ObjectSpec& object : job.scene.objects) {
    if (object.category != Category::fixed) ++movable;
    if (object.category == Category::avatar) ++avatars;
  }
  const Deployment deployment = job.service.deployment;
  counts.user_hosted = deployment == Deployment::user ? movable : avatars;
  (deployment == Deployment::user_server ? counts.server_hosted : counts.node_hosted) = movable - counts.user_hosted;
  counts.moved = figures.mean(static_cast<double>(figures.totals.moved));
  counts.tested = figures.mean(static_cast<double>(figures.tested));
  counts.contacts = figures.mean(static_cast<double>(figures.contacts));
  counts.handed_over = figures.mean(static_cast<double>(figures.totals.handed_over));
  counts.busiest_tested = figures.mean(busiest_tested);
  counts.publication_notices = job.service.interest > 0 ? counts.users : 0;
  for (std::size_t i = 0; i < traffic_count; ++i) {
    const TrafficReport traffic = figures.traffic(static_cast<Traffic>(i));
    counts.traffic[i] = {figures.mean(static_cast<double>(traffic.messages)),
                         figures.mean(static_cast<double>(traffic.records)),
                         figures.mean(static_cast<double>(traffic.bytes))};
  }
  return counts;
}

}  // namespace

std::optional<ScaleSample> run_sample(const Job& job, const std::function<bool()>& step) {
  World world(world_config(job));
  worlds::load_into(world, job.scene, job.service.users);
  FrameChecker checker(world, false);
  for (std::uint32_t frame = 0; frame < job.frames.warmup; ++frame) {
    advance(world, frame);
    checker.skip_frame();
    if (!step()) return {};
  }
  Figures figures;
  FrameSamples samples;
  for (std::uint32_t frame = 0; frame < job.frames.frames; ++frame) {
    advance(world, std::uint64_t{job.frames.warmup} + frame);
    figures.add(world.report(), world.contacts());
    samples.add(world.report(), job.service.nodes);
    checker.check_frame(frame);
    if (!step()) return {};
  }
  ScaleSample sample;
  sample.wall_ms = median(samples.wall);
  sample.server_ms = median(samples.server);
  sample.node_ms = median(samples.node);
  sample.users_ms = median(samples.users);
  sample.path_ms = median(samples.path);
  sample.undisturbed_ms = job.service.nodes > 0 ? samples.steps.undisturbed().critical_ms() : sample.path_ms;
  sample.imbalance = figures.cpu_imbalance.mean();
  double busy_ms = 0, cpu_ms = 0;
  for (const NodeFigures& node : figures.nodes()) {
    sample.narrow_phase_ms += node.narrow_phase_ms;
    sample.move_ms += node.move_ms;
    busy_ms += node.busy_ms;
    cpu_ms += node.cpu_ms;
  }
  sample.broad_phase_ms = figures.stage_ms(Stage::broad_phase);
  // These are wall times. Scale them to the time in which the threads had a core, so that other load on the machine
  // does not increase them.
  const double on_core = busy_ms > 0 ? std::min(1.0, cpu_ms / busy_ms) : 1;
  for (double* const ms : {&sample.narrow_phase_ms, &sample.move_ms, &sample.broad_phase_ms}) *ms *= on_core;
  sample.digest = figures.digest();
  sample.counts_match = checker.passed();
  sample.counts = counts_of(job, figures, samples.busiest_tested);
  sample.counts.placement = world.config().placement;
  return sample;
}

}  // namespace ringfence::tools
