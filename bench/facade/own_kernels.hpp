#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "facade/recorded_world.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::bench {

/// The objects of a recorded world in the layout of our broad phase and kernels.
class Crowd {
 public:
  explicit Crowd(const RecordedWorld& world);

  /// Copies the poses of objects `first` to `end` - 1 and computes their bounds. May be called for disjoint ranges from
  /// any threads.
  void place(const std::vector<Pose>& poses, std::size_t first, std::size_t end);

  std::span<const narrow_phase::Body> bodies() const noexcept { return bodies_; }
  std::span<const geometry::Bounds> bounds() const noexcept { return bounds_; }
  std::span<const std::uint8_t> present() const noexcept { return present_; }
  std::span<const std::uint8_t> resting() const noexcept { return resting_; }

 private:
  const RecordedWorld& world_;
  std::vector<narrow_phase::Body> bodies_;
  std::vector<geometry::Bounds> bounds_;
  std::vector<std::uint8_t> present_, resting_;
};

/// Tests pairs with our kernels and stores the contacts with all fields of the API. Threads: one at a time.
class PairTester {
 public:
  explicit PairTester(const geometry::ShapeTable& shapes) : narrow_(shapes) {}
  void clear() noexcept { found_.clear(); }
  void test(std::span<const narrow_phase::Body> bodies, std::span<const geometry::CandidatePair> pairs);
  const ContactList& found() const noexcept { return found_; }

 private:
  narrow_phase::NarrowPhase narrow_;
  ContactList found_;
};

}  // namespace ringfence::bench
