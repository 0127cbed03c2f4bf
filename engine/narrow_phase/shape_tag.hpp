#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "geometry/shape_view.hpp"

namespace ringfence::narrow_phase {

/// Up to a ratio of sizes of 2^5, rounding to float (about 10^-7 of the larger size) is far below 10^-4 of the smaller
/// size.
inline constexpr int float_octaves = 5;

/// The properties of a shape by which pairs are sorted, in one word: its kind, and its sizes as two sets of octaves.
/// One set holds all octaves up to the bounding radius, the other all octaves too large for float next to the least
/// size. A pair needs double if the two sets, each united over both shapes, have a common octave: a few operations, no
/// branch.
class ShapeTag {
 public:
  ShapeTag(ShapeKind kind, float large, float small) noexcept {
    const std::uint64_t up_to = (std::uint64_t{2} << octave(large)) - 1;
    const std::uint64_t too_large = (all << (octave(small) + float_octaves + 1)) & all;
    word_ = static_cast<std::uint64_t>(kind) << (2 * octaves) | too_large << octaves | up_to;
  }

  static bool same_kind(std::span<const ShapeTag> tags) noexcept {
    return std::all_of(tags.begin(), tags.end(), [&](ShapeTag tag) { return tag.kind() == tags.front().kind(); });
  }

  /// Whether no pair of these shapes needs double.
  static bool float_is_enough(std::span<const ShapeTag> tags) noexcept {
    std::uint64_t sizes = 0;
    for (const ShapeTag& tag : tags) sizes |= tag.word_;
    return (sizes & sizes >> octaves & all) == 0;
  }

  std::size_t kind() const noexcept { return word_ >> (2 * octaves); }
  static bool needs_double(ShapeTag a, ShapeTag b) noexcept {
    const std::uint64_t both = a.word_ | b.word_;
    return (both & both >> octaves & all) != 0;
  }

 private:
  static constexpr int octaves = 30;  ///< 2^-10 to 2^20 metres: all permitted sizes
  static constexpr std::uint64_t all = (std::uint64_t{1} << octaves) - 1;

  static int octave(float size) noexcept {
    constexpr int bias = 126;  // of the exponent, where the mantissa is from 0.5 to 1
    const int power = static_cast<int>(std::bit_cast<std::uint32_t>(size) >> 23) - bias;
    return std::clamp(power + 9, 0, octaves - 1);
  }

  std::uint64_t word_;
};

/// The smallest size that matters beside a larger shape: of a box its least half extent.
inline float least_size(const geometry::ShapeRow& row) noexcept {
  switch (row.kind) {
    case ShapeKind::sphere:
    case ShapeKind::capsule:
      return row.size[0];
    case ShapeKind::box:
      return std::min({row.size[0], row.size[1], row.size[2]});
    default:
      return row.bounding_radius;
  }
}

/// The tag of a shape.
inline ShapeTag tag_of(const geometry::ShapeRow& row) noexcept {
  return {row.kind, row.bounding_radius, least_size(row)};
}

}  // namespace ringfence::narrow_phase
