#include "facade/results/world_log.hpp"

#include <utility>

namespace ringfence::facade {

void WorldLog::write(LogLevel level, const std::string& line) const {
  if (hook_) {
    hook_(level, line);
  }
}

void WorldLog::log_dropped_triangles(ShapeNumber shape, const geometry::Mesh& mesh) const {
  if (mesh.dropped_triangles() > 0) {
    write(LogLevel::warning, "shape " + std::to_string(shape) + ": " + std::to_string(mesh.dropped_triangles()) +
                                 " triangles without area are dropped from the mesh, " +
                                 std::to_string(mesh.triangles().size()) + " are kept");
  }
}

void WorldLog::log_losses(const FrameReport& report, std::size_t left, bool abandoned) const {
  const std::string frame = " in frame " + std::to_string(report.frame);
  if (abandoned) {
    write(LogLevel::error, "the thread of a lost CD node has stopped while it was reading memory of the others" +
                               frame + ": all CD nodes are lost with it, and new ones replace them");
  }
  for (const NodeId node : report.lost) {
    write(LogLevel::error, "CD node " + std::to_string(node.number()) + " stopped answering" + frame +
                               ": other nodes take over its regions, pairs and objects; " + std::to_string(left) +
                               " left");
  }
  for (const UserId user : report.late) {
    write(LogLevel::warning, "user node " + std::to_string(user.number()) + " missed its deadline" + frame +
                                 ": its objects did not move, and it is disconnected at the next cut");
  }
}

void WorldLog::log_growth(const FrameReport& report) {
  if (report.grown == 0 || std::exchange(growth_logged_, true)) {
    return;
  }
  write(LogLevel::warning, "frame " + std::to_string(report.frame) +
                               " outgrew what was reserved: " + std::to_string(report.objects) + " objects, " +
                               std::to_string(report.candidates) + " pairs, " + std::to_string(report.contacts) +
                               " contacts; raise WorldConfig::capacities to keep frames free of allocations");
}

void WorldLog::log_support_failures(std::span<const std::string> failures, const FrameReport& report,
                                    bool remote_nodes) {
  for (const std::string& failure : failures) {
    write(LogLevel::warning, failure + "; pairs for which it fails have no contact, see FrameReport::failed_supports");
  }
  if (!remote_nodes || report.failed_supports == 0 || std::exchange(remote_failures_logged_, true)) {
    return;
  }
  write(LogLevel::warning, "frame " + std::to_string(report.frame) + ": " + std::to_string(report.failed_supports) +
                               " pairs have no contact, since a support function failed on a CD node; see its log");
}

void WorldLog::log_model_failures(const FrameReport& report) {
  constexpr std::uint32_t max_logged = 100;
  for (const ModelFailure& failure : report.model_failures) {
    if (model_failures_logged_ == max_logged) {
      return;
    }
    ++model_failures_logged_;
    write(LogLevel::warning, "frame " + std::to_string(report.frame) + ": the motion model threw for object " +
                                 std::to_string(failure.object.number()) + ": " + failure.text +
                                 (model_failures_logged_ == max_logged ? "; further failures are not logged" : ""));
  }
}

void WorldLog::log_halt(std::uint64_t frame) noexcept {
  if (std::exchange(halt_logged_, true)) {
    return;
  }
  try {
    write(LogLevel::error, "memory ran out in frame " + std::to_string(frame) +
                               ": the World runs no more frames and returns out_of_memory; its last results can be "
                               "read. Destroy it, and give the next one more memory or fewer objects");
  } catch (...) {
    // There is no memory for the log line either; the caller still gets the status.
  }
}

}  // namespace ringfence::facade
