#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/numbers.hpp"
#include "geometry/mesh.hpp"
#include "ringfence/config.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence::facade {

/// The log of a World. What can happen in every frame is logged once, or a limited number of times.
///
/// Threads: the one that calls World; so does the hook. Throws std::bad_alloc, and what the hook throws.
class WorldLog {
 public:
  /// `hook` outlives this object; nothing is logged if it is null.
  explicit WorldLog(const LogHook& hook) noexcept : hook_(hook) {}
  WorldLog(const WorldLog&) = delete;
  WorldLog& operator=(const WorldLog&) = delete;

  /// Logs one line, each time.
  void write(LogLevel level, const std::string& line) const;
  /// Logs how many triangles without area a new mesh has lost, unless it has lost none.
  void log_dropped_triangles(ShapeNumber shape, const geometry::Mesh& mesh) const;
  /// Logs the CD nodes and the user nodes that the frame lost. `left` is the number of CD nodes that remain;
  /// `abandoned`: see ServerRole::has_abandoned_nodes.
  void log_losses(const FrameReport& report, std::size_t left, bool abandoned) const;
  /// Logs the first frame that outgrew what was reserved.
  void log_growth(const FrameReport& report);
  /// Logs `failures` of support functions in this process. With `remote_nodes`, also the first frame in which one
  /// failed in any process: this process does not have the reasons of the others.
  void log_support_failures(std::span<const std::string> failures, const FrameReport& report, bool remote_nodes);
  /// Logs the failures of the motion model in the report, 100 in the life of the World.
  void log_model_failures(const FrameReport& report);
  /// Logs that memory ran out in `frame`, once. Does not throw: without memory for the line there is none.
  void log_halt(std::uint64_t frame) noexcept;

 private:
  const LogHook& hook_;
  std::uint32_t model_failures_logged_ = 0;
  bool growth_logged_ = false;
  bool remote_failures_logged_ = false;
  bool halt_logged_ = false;
};

}  // namespace ringfence::facade
