#pragma once

#include <cstddef>
#include <cstdint>

#include "broad_phase/buffer.hpp"
#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// Where the kernels put what they find.
///
/// `candidates` are pairs of sorted positions (low half the one that looks, high half the one found) that the exact
/// test has yet to see; a kernel drains them into `pairs` before it returns.
struct PairSink {
  Buffer<std::uint64_t> candidates;
  Buffer<geometry::CandidatePair> pairs;
  std::size_t count = 0;  ///< pairs found

  /// Candidates after which a kernel drains; beyond them one box's finds still fit.
  static constexpr std::size_t drain_at = 1024;

  /// Room for the finds of one box among `others`, and of `drain_at` before it. `slack` is a vector's width.
  void open(std::size_t others) { candidates.reserve(drain_at + others + slack); }

  /// Room for `more` pairs.
  geometry::CandidatePair* claim(std::size_t more) {
    if (count + more > pairs.capacity()) pairs.grow(count + more, count);
    return pairs.data() + count;
  }

  static constexpr std::size_t slack = 64;
};

}  // namespace ringfence::broad_phase
