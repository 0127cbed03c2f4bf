#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "base/zeroed_array.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

/// A cache of separating axes. A pair of hulls that was apart often stays separated by the same axis; if the axis still
/// separates the pair by a margin, the rest of the test is skipped.
///
/// The table has a fixed number of slots, each with the axis of the last pair that was written to it. So it does not
/// grow, and it needs no update when objects end or move to another node. A slot is only a guess, possibly of another
/// pair. The caller proves that the axis separates the pair, so a lost or wrong entry cannot change a result.
///
/// Threads: one at a time. Memory: 128 bytes a body, 16 to 128 KiB, allocated by the constructor.
class AxisMemory {
 public:
  struct Slot {
    std::uint32_t tag = 0;  ///< identifies the pair; 0: empty
    Vec3f axis;             ///< unit, world axes, from the first body of the pair to the second
  };
  static_assert(sizeof(Slot) == 16);

  /// Where the axis of a pair is stored, in a table of the largest size, and the tag of the pair.
  struct Key {
    std::size_t slot;
    std::uint32_t tag;
  };

  /// For pairs of about so many bodies; with more bodies, more pairs share a slot.
  explicit AxisMemory(std::size_t bodies)
      : slots_(std::bit_ceil(std::clamp(std::min(bodies, most_slots) * slots_of_body, least_slots, most_slots))) {}

  static Key key_of(ObjectNumber first, ObjectNumber second) noexcept {
    // Multiplication by an odd constant (Knuth, Fibonacci hashing): the high bits depend on all bits of both numbers.
    const std::uint64_t hash = (std::uint64_t{first} << 32 | second) * 0x9e3779b97f4a7c15u;
    return {static_cast<std::size_t>(hash >> (64 - most_slots_log2)), static_cast<std::uint32_t>(hash >> 16) | 1};
  }

  Slot& operator[](Key key) noexcept { return slots_[key.slot & (slots_.size() - 1)]; }
  void clear() noexcept {
    for (std::size_t i = 0; i < slots_.size(); ++i) slots_[i].tag = 0;
  }

 private:
  static constexpr int most_slots_log2 = 13;
  static constexpr std::size_t most_slots = std::size_t{1} << most_slots_log2;
  static constexpr std::size_t least_slots = 1024;
  static constexpr std::size_t slots_of_body = 8;
  base::ZeroedArray<Slot> slots_;  ///< a power of two
};

}  // namespace ringfence::narrow_phase
