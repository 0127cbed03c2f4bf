#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// Finds every candidate pair of a frame, each exactly once.
///
/// Threads: one instance belongs to one thread at a time. Memory: grows to the largest frame seen, never shrinks; in
/// steady state nothing is allocated.
class SweepAndPrune {
 public:
  /// Reserves for `objects` objects and `pairs` pairs. Both may be exceeded later, at the price of an allocation.
  SweepAndPrune(std::size_t objects, std::size_t pairs);
  ~SweepAndPrune();
  SweepAndPrune(SweepAndPrune&&) noexcept;
  SweepAndPrune& operator=(SweepAndPrune&&) noexcept;

  /// All pairs i, j (i < j is not promised) with touch(bounds[i], bounds[j]) among those with present[i] and
  /// present[j] non-zero, in no particular order.
  ///
  /// `resting[i]` is non-zero where bounds[i] and present[i] are what they were at the last call (a promise that the
  /// sweep may use; all zero is always right). The three spans have equal size, which may differ from call to call.
  /// The result lives until the next call.
  std::span<const geometry::CandidatePair> find(std::span<const geometry::Bounds> bounds,
                                                std::span<const std::uint8_t> present,
                                                std::span<const std::uint8_t> resting);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence::broad_phase
