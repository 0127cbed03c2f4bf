#pragma once

#include <cstdint>
#include <new>
#include <span>
#include <vector>

#include "ringfence/profile.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::telemetry {

/// The timeline of one role in one frame: named spans of the monotonic clock. Names are string literals.
///
/// Threads: the role's thread writes it during a frame, and the facade reads it between frames. No lock is needed,
/// because the messages of the frame order the two. Memory: grows to the busiest frame.
class Track {
 public:
  void clear() noexcept { spans_.clear(); }
  /// Does not throw, because the destructor of SpanTimer calls it: if memory runs out, the span is dropped.
  void add(const char* name, std::uint64_t begin_ns, std::uint64_t end_ns) noexcept {
    try {
      spans_.push_back({0, name, begin_ns, end_ns});
    } catch (const std::bad_alloc&) {
    }
  }
  std::span<const TimelineSpan> spans() const noexcept { return spans_; }

 private:
  std::vector<TimelineSpan> spans_;
};

/// Measures the duration of a scope, adds it to a total, and adds a span to a track. If the track is null, the cost is
/// two reads of the clock.
class SpanTimer {
 public:
  /// `track` may be null. `name` is a string literal, `total` is in ns. `track` and `total` outlive the timer.
  SpanTimer(Track* track, const char* name, std::uint64_t& total) noexcept
      : track_(track), name_(name), total_(total), begin_ns_(now_ns()) {}
  ~SpanTimer() {
    const std::uint64_t end_ns = now_ns();
    total_ += end_ns - begin_ns_;
    if (track_ != nullptr) {
      track_->add(name_, begin_ns_, end_ns);
    }
  }
  SpanTimer(const SpanTimer&) = delete;
  SpanTimer& operator=(const SpanTimer&) = delete;

 private:
  Track* track_;
  const char* name_;
  std::uint64_t& total_;
  std::uint64_t begin_ns_;
};

}  // namespace ringfence::telemetry
