#pragma once

#include <cstddef>
#include <cstdint>

#include "base/buffer.hpp"
#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// The sorted positions [first, end) to compare with the box at position `origin`.
struct Window {
  std::uint32_t origin, first, end;
};

/// Buffers for the output of the kernels.
///
/// A *hit* is a group of boxes whose codes match the code of one box (its origin). The exact test of a hit is still
/// pending. A kernel runs the exact test of all its hits before it returns, which moves them to `pairs`.
struct PairSink {
  base::Buffer<std::uint64_t>
      hit_positions;  ///< by hit: low half, position of the origin; high half, position of bit 0 of the mask
  base::Buffer<std::uint32_t> hit_masks;    ///< by hit: bit mask of the boxes whose codes match; never 0
  base::Buffer<std::uint64_t> box_indices;  ///< by hit: the indices of two boxes; scratch memory of the exact test
  base::Buffer<std::uint32_t> crossing;     ///< boxes of the current block that reach into other rows
  base::Buffer<Window> windows;             ///< the positions in those rows to compare with them
  base::Buffer<geometry::CandidatePair> pairs;
  std::size_t count = 0;  ///< number of pairs found

  /// Boxes per block. The exact tests run after each block: enough boxes to overlap the memory accesses, few enough to
  /// stay in the cache.
  static constexpr std::uint32_t block = 1024;
  /// With more hits than this the exact tests run before the end of the block. The hits of one more box still fit.
  static constexpr std::size_t max_untested_hits = 1024;

  /// Reserves room for `max_untested_hits` hits and those of one more box among `boxes`.
  void open(std::size_t boxes) {
    const std::size_t hits = max_untested_hits + boxes + 64;
    hit_positions.reserve(hits);
    hit_masks.reserve(hits);
    box_indices.reserve(hits);
    crossing.reserve(block);
    windows.reserve(7 * block);  // up to three other rows, and each of the four may wrap around
  }

  /// Makes room for `more` pairs and returns where they start.
  geometry::CandidatePair* claim(std::size_t more) {
    if (count + more > pairs.capacity()) pairs.grow(count + more, count);
    return pairs.data() + count;
  }
};

}  // namespace ringfence::broad_phase
