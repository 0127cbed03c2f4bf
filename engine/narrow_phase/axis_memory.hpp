#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

/// For pairs that were apart, an axis that separated them: where it still does, by a margin, nothing else need be
/// tried.
///
/// A fixed number of slots, each the last pair's that was written to it; so it neither grows nor has to be told of
/// objects that end or move to another node. What a slot holds is a guess, of whatever pair: it is the caller who
/// proves with it, so nothing that is remembered, lost or mistaken can change an answer.
///
/// Threads: one at a time. Memory: 128 KiB, taken when made.
class AxisMemory {
 public:
  struct Slot {
    std::uint32_t tag = 0;  ///< of the pair; 0 where there is none
    Vec3f axis;             ///< unit, world axes, from the first body of the pair to the second
  };
  static_assert(sizeof(Slot) == 16);

  /// What two objects are found by.
  struct Key {
    std::size_t slot;
    std::uint32_t tag;
  };
  static Key key_of(ObjectNumber first, ObjectNumber second) noexcept {
    // Multiplication by an odd constant (Knuth, Fibonacci hashing): the high bits depend on all of both.
    const std::uint64_t hash = (std::uint64_t{first} << 32 | second) * 0x9e3779b97f4a7c15u;
    return {static_cast<std::size_t>(hash >> (64 - slots_log2)), static_cast<std::uint32_t>(hash >> 16) | 1};
  }

  Slot& operator[](Key key) noexcept { return slots_[key.slot]; }
  void clear() noexcept {
    for (std::size_t i = 0; i < slots; ++i) slots_[i].tag = 0;
  }

 private:
  static constexpr int slots_log2 = 13;
  static constexpr std::size_t slots = std::size_t{1} << slots_log2;
  std::unique_ptr<Slot[]> slots_ = std::make_unique<Slot[]>(slots);
};

}  // namespace ringfence::narrow_phase
