#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>

#include "ringfence/fault.hpp"

namespace ringfence::nodes {

/// Releases all roles that a Fault has stopped. Each World has one.
///
/// Threads: any. Uses a lock, which a role takes only when a Fault stops it.
class FaultRelease {
 public:
  /// Ends all stops, and cancels the faults that have not stopped a role yet. Returns how many threads were blocked
  /// within a step.
  std::uint32_t release() noexcept;
  /// Number of calls of release(). FaultPoint::set() stores it with the fault.
  std::uint64_t releases() const noexcept;
  /// Blocks the calling thread until `stall` has passed (0: no limit) or until there are more releases than `since`.
  void stop_thread(std::uint64_t since, std::chrono::nanoseconds stall) noexcept;

 private:
  mutable std::mutex mutex_;
  std::condition_variable released_;
  std::uint64_t releases_ = 0;
  std::uint32_t stopped_ = 0;  ///< threads in stop_thread()
};

/// Stops a role as an injected Fault requires, in one of two ways. Between two steps of the frame the role does nothing
/// when it is stepped, until the stop ends. Within a step the thread that steps the role blocks.
///
/// Threads: only the thread that steps the role. Without a fault each call costs one test.
class FaultPoint {
 public:
  /// `release` outlives this object. If it is null, the role does not stop within a step, and only time ends its other
  /// stops.
  explicit FaultPoint(FaultRelease* release) noexcept : release_(release) {}

  /// Sets the fault, and replaces one that was set before. Call it between frames, while no thread steps the role.
  void set(const Fault& fault) noexcept;
  /// Called between two steps: whether the role stops before `stage`.
  bool stops_before(NodeStage stage, std::uint64_t frame) noexcept { return fault_ && stop_before(stage, frame); }
  /// Called within a step: blocks the calling thread if the fault applies here.
  void pass(NodeStage stage, std::uint64_t frame) noexcept {
    if (fault_) [[unlikely]] {
      stop_inside(stage, frame);
    }
  }
  /// Whether the role is stopped between two steps.
  bool is_stopped(std::uint64_t now_ns) noexcept { return until_ns_ != 0 && stop_lasts(now_ns); }

 private:
  bool stop_before(NodeStage stage, std::uint64_t frame) noexcept;
  bool is_due(NodeStage stage, std::uint64_t frame) noexcept;
  void stop_inside(NodeStage stage, std::uint64_t frame) noexcept;
  bool stop_lasts(std::uint64_t now_ns) noexcept;

  FaultRelease* release_;
  std::optional<Fault> fault_;  ///< until it stops the role
  std::uint64_t since_ = 0;     ///< number of releases when the fault was set
  /// How often the role still passes the point of the fault before it stops; see Fault::passes.
  std::uint32_t passes_left_ = 0;
  std::uint64_t until_ns_ = 0;  ///< end of a stop between two steps; 0: not stopped
};

}  // namespace ringfence::nodes
