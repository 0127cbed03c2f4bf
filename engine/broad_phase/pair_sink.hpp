#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/buffer.hpp"
#include "broad_phase/crowds.hpp"
#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// Positions [first, end) in the sorted order whose boxes are compared with the box at position `origin`.
struct Window {
  std::uint32_t origin, first, end;
};

/// Buffers for the output of the kernels.
///
/// A *hit* is a group of boxes whose codes match the code of one box (its origin). Matching codes do not prove an
/// overlap: before a kernel returns, it tests all boxes of its hits exactly, and appends the pairs that overlap or
/// touch to `pairs`.
///
/// Threads: one instance belongs to one thread at a time. Memory: grows, never shrinks; open() and claim() throw
/// std::bad_alloc.
struct PairSink {
  /// By hit: the low half is the position of the origin, the high half the position of bit 0 of the mask.
  base::Buffer<std::uint64_t> hit_positions;
  base::Buffer<std::uint32_t> hit_masks;    ///< by hit: bit mask of the boxes whose codes match; never 0
  base::Buffer<std::uint64_t> box_indices;  ///< by hit: the indices of two boxes; scratch memory of the exact test
  base::Buffer<std::uint32_t> crossing;     ///< positions of the boxes of the current block that reach into other rows
  base::Buffer<Window> windows;             ///< of the current block: windows in other rows, and those that wrap around
  base::Buffer<geometry::CandidatePair> pairs;
  std::size_t count = 0;                  ///< number of pairs found
  std::span<const std::uint32_t> groups;  ///< by slot: 0, or the group of the object; empty where no object has one
  std::span<const std::uint32_t> crowds;  ///< by slot; empty where no found pair can be excluded by its crowd

  /// Boxes per block. The exact tests run after each block. A block has enough boxes that their memory accesses overlap
  /// in time, and few enough that they stay in the cache.
  static constexpr std::uint32_t block = 1024;
  /// If there are more hits than this, the exact tests run before the end of the block. The buffers have room for this
  /// number and the hits of one more box.
  static constexpr std::size_t max_untested_hits = 1024;

  /// Reserves room for `max_untested_hits` hits and those of one more box among `boxes`.
  void open(std::size_t boxes) {
    const std::size_t hits = max_untested_hits + boxes + 64;  // of which few are used, unless a box overlaps thousands
    hit_positions.grow(hits, 0, base::Pages::small);
    hit_masks.grow(hits, 0, base::Pages::small);
    box_indices.grow(hits, 0, base::Pages::small);
    crossing.reserve(block);
    windows.reserve(7 * block);  // a box has up to two in each of three other rows and one in its own, if rows wrap
  }

  bool filters() const noexcept { return !groups.empty() || !crowds.empty(); }
  /// Removes the pairs that groups and crowds exclude from [first, last) and returns the new end.
  geometry::CandidatePair* drop_excluded(geometry::CandidatePair* first, geometry::CandidatePair* last) const noexcept {
    if (!groups.empty()) last = drop_same_group(first, last);
    return crowds.empty() ? last : drop_same_crowd(first, last);
  }
  geometry::CandidatePair* drop_same_crowd(geometry::CandidatePair* first,
                                           geometry::CandidatePair* last) const noexcept {
    return std::remove_if(first, last, [this](const geometry::CandidatePair& pair) {
      return !crowds_collide(crowds[pair.a], crowds[pair.b]);
    });
  }
  geometry::CandidatePair* drop_same_group(geometry::CandidatePair* first,
                                           geometry::CandidatePair* last) const noexcept {
    geometry::CandidatePair* to = first;
    for (; first != last; ++first) {
      const geometry::CandidatePair pair = *first;
      *to = pair;
      to += groups[pair.a] == 0 || groups[pair.a] != groups[pair.b];
    }
    return to;
  }

  /// Makes room for `more` pairs after the first `count` and returns where they start. The caller writes them and adds
  /// their number to `count`.
  geometry::CandidatePair* claim(std::size_t more) {
    if (count + more > pairs.capacity()) pairs.grow(count + more, count);
    return pairs.data() + count;
  }
};

}  // namespace ringfence::broad_phase
