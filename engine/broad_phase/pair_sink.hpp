#pragma once

#include <cstddef>
#include <cstdint>

#include "base/buffer.hpp"
#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// Sorted positions from `first` up to `end` that are to be compared with the box at position `asker`.
struct Window {
  std::uint32_t origin, first, end;
};

/// Where the kernels put what they find.
///
/// A *find* is what the codes let through of a few boxes that were compared with one: the exact test has yet to see
/// it. A kernel drains the finds into `pairs` before it returns.
struct PairSink {
  base::Buffer<std::uint64_t>
      positions;                       ///< by find: of the box that asked; in the high half, of the first of the others
  base::Buffer<std::uint32_t> others;  ///< by find, those that may overlap it, by bits from the first on; not 0
  base::Buffer<std::uint64_t> to_test;   ///< by find, two indices of boxes: scratch of the exact test
  base::Buffer<std::uint32_t> crossing;  ///< of the boxes swept since the last exact tests: which reach into other rows
  base::Buffer<Window> windows;          ///< and what they meet there
  base::Buffer<geometry::CandidatePair> pairs;
  std::size_t count = 0;  ///< pairs found

  /// Boxes between two exact tests: so many that their memory is fetched at once, so few that it stays in the cache.
  static constexpr std::uint32_t block = 1024;
  /// Finds after which a kernel drains before that; beyond them one box's finds still fit.
  static constexpr std::size_t max_untested_hits = 1024;

  /// Room for the finds of one box among `boxes`, and of `max_untested_hits` before it.
  void open(std::size_t boxes) {
    const std::size_t hits = max_untested_hits + boxes + 64;
    positions.reserve(hits);
    others.reserve(hits);
    to_test.reserve(hits);
    crossing.reserve(block);
    windows.reserve(7 * block);  // three rows beyond its own, and each of the four may wrap around
  }

  /// Room for `more` pairs.
  geometry::CandidatePair* claim(std::size_t more) {
    if (count + more > pairs.capacity()) pairs.grow(count + more, count);
    return pairs.data() + count;
  }
};

}  // namespace ringfence::broad_phase
