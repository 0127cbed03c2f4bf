#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include "ringfence/query.hpp"

namespace ringfence::tools {

/// Digest of answers. Runs whose answers have the same hits, bit for bit, have the same digest; different ones give
/// different digests except for hash collisions. It covers what the rows of an answer file have.
class AnswerDigest {
 public:
  /// Adds the hits of one query. Frames, and the queries of a frame, come in ascending order.
  void add(std::uint32_t frame, std::uint32_t query, std::span<const Hit> hits) noexcept {
    for (const Hit& hit : hits) {
      add_bits(std::uint64_t{frame} << 32 | query);
      add_bits(hit.object.number());
      add_bits(std::uint64_t{hit.child} << 32 | hit.triangle);
      for (const double value : {hit.fraction, hit.distance, hit.point.x, hit.point.y, hit.point.z, hit.normal.x,
                                 hit.normal.y, hit.normal.z}) {
        add_bits(std::bit_cast<std::uint64_t>(value));
      }
    }
  }
  std::uint64_t value() const noexcept { return value_; }

 private:
  // The finaliser of splitmix64 (Steele, Lea, Flood 2014).
  void add_bits(std::uint64_t bits) noexcept {
    std::uint64_t x = value_ ^ (bits + 0x9e3779b97f4a7c15u);
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    value_ = x ^ (x >> 31);
  }

  std::uint64_t value_ = 0;
};

/// Totals over the counted frames.
struct QueryFigures {
  QueryWork work;
  std::uint64_t hits = 0;  ///< rows of the answers
  double ms = 0;           ///< wall time, with that of World::snapshot()
  AnswerDigest digest;
};

}  // namespace ringfence::tools
