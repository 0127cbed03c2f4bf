// The edges in the test of two hulls, for a block of pairs. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_HULL_EDGE_PAIRS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_HULL_EDGE_PAIRS_INL
#undef RINGFENCE_NARROW_PHASE_HULL_EDGE_PAIRS_INL
#else
#define RINGFENCE_NARROW_PHASE_HULL_EDGE_PAIRS_INL
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/prefetch.hpp"
#include "narrow_phase/hull/hull_bounds-inl.hpp"
#include "narrow_phase/hull/hull_edges-inl.hpp"
#include "narrow_phase/hull/hull_pairs-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

#if HWY_TARGET != HWY_SCALAR

/// Finds the directions across an edge of each hull that have less overlap than all faces, and removes the pairs that
/// such a direction separates. The result is that of PolytopePair::separated_by_edges, which tests one edge of the
/// first hull after the other.
///
/// The edges that the bounds do not exclude, about four of each hull, are tested in tiles: each block of four lanes has
/// one edge of the first hull and four of the second. The few that are better than the best face are then evaluated one
/// at a time, in the order of the edges, because among equals the first is chosen.
class HullEdgePairs {
 public:
  HullEdgePairs(HullPairs& pairs, HullBounds& bounds) : pairs_(pairs), bounds_(bounds) {}

  void run() {
    list_edges();
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::size_t i = pairs_.undecided.pair[u];
      if (tiles_ + 1 > max_tiles / 2) evaluate_chosen();
      if (count_[0][i] > 0 && count_[1][i] > 0) test_tiles(i);
    }
    evaluate_chosen();
    pairs_.remove_separated([&](std::size_t i) { return at(pairs_.best_direction, i); });
  }

  /// The pairs that have too many candidate edges for this class; one bit each. They are to be tested one at a time.
  std::uint32_t left_over() const { return left_over_; }

 private:
  using D = HullPairs::D;
  using V = HullPairs::V;
  static constexpr D d{};
  static constexpr std::size_t lanes = HullPairs::lanes;
  static constexpr std::size_t blocks = lanes / 4;  ///< edges of the first hull in a tile
  using D4 = hn::FixedTag<float, 4>;
  static constexpr D4 d4{};

  static constexpr std::size_t max_listed = 128;  ///< edges of one hull
  static constexpr std::size_t max_tiles = 64;
  static constexpr std::size_t max_chosen = 512;

  HWY_INLINE const geometry::Hull& hull(std::size_t side, std::size_t i) const { return *pairs_.hull[side][i]; }

  /// Lists the edges of both hulls that neither the points nor the ball exclude; see PolytopePair::list_edges.
  void list_edges() {
    alignas(64) std::uint8_t bytes[2][block_pairs][max_faces];
    bounds_.limit_edges();
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::size_t i = pairs_.undecided.pair[u];
      for (std::size_t side = 0; side < 2; ++side) bounds_.mark_faces(side, i, bytes[side][i]);
    }
    std::size_t used = 0;
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::size_t i = pairs_.undecided.pair[u];
      for (std::size_t side = 0; side < 2; ++side) {
        list_[side][i] = pool_ + used;
        std::size_t count =
            list_edges_where(polytope_of(hull(side, i)), bytes[side][i], NoCommonBit(), std::uint16_t{0}, pool_ + used);
        if (HWY_UNLIKELY(count > max_listed)) {
          count = 0;
          left_over_ |= 1u << i;
        }
        count_[side][i] = count;
        used += count;
        prefetch_edges(side, i);
      }
    }
  }

  /// The edges of all hulls together are larger than the first-level cache, and the tiles read few of them.
  HWY_INLINE void prefetch_edges(std::size_t side, std::size_t i) const {
    const geometry::HullEdge* const edges = hull(side, i).edges().data();
    const std::uint16_t* const list = list_[side][i];
    const std::size_t count = count_[side][i];
    // Four at a time, the last one again where there are fewer: the number of edges is unpredictable.
    for (std::size_t k = 0; k < count; k += 4) {
      for (std::size_t m = 0; m < 4; ++m) base::prefetch_for_read(edges + list[std::min(k + m, count - 1)]);
    }
  }

  /// What is known of the edge pairs of a tile in which some pair is better than the best face.
  struct Tile {
    alignas(64) float across[3][lanes];  ///< the common perpendicular, outwards from the first hull; not unit
    alignas(64) float gap[3][lanes];     ///< from the second hull's edge to the first's
    alignas(64) float sine_squared[lanes];
    alignas(64) float crossing[lanes];  ///< by how much the arcs of normals cross
    alignas(64) float value[lanes];     ///< the overlap times the length of `across`
  };

  /// A group of four edges of the second hull, in the axes of the first: left and right normal, a point, the direction.
  struct Group {
    alignas(16) float value[12][4];
  };

  HWY_INLINE void gather_group(std::size_t i, std::size_t begin, const Rotation<D4>& r, const Vector<D4>& offset,
                               Group& to) const {
    const geometry::HullEdge* const edges = hull(1, i).edges().data();
    const std::uint16_t* const list = list_[1][i];
    const std::size_t last = count_[1][i] - 1;
    const float* row[4];
    for (std::size_t k = 0; k < 4; ++k) row[k] = &edges[list[std::min(begin + k, last)]].left_normal.x;
    hn::Vec<D4> left[4], right[4], along[4];
    const auto gather = [&](std::size_t k, hn::Vec<D4>* out) HWY_ATTR {
      transpose(d4, hn::Load(d4, row[0] + 4 * k), hn::Load(d4, row[1] + 4 * k), hn::Load(d4, row[2] + 4 * k),
                hn::Load(d4, row[3] + 4 * k), out);
    };
    gather(0, left);
    gather(1, right);
    gather(2, along);
    const auto put = [&](const Vector<D4>& v, std::size_t k) HWY_ATTR {
      hn::Store(v.x, d4, to.value[k]);
      hn::Store(v.y, d4, to.value[k + 1]);
      hn::Store(v.z, d4, to.value[k + 2]);
    };
    put(rotate(d4, r, Vector<D4>{left[0], left[1], left[2]}), 0);
    put(rotate(d4, r, Vector<D4>{right[0], right[1], right[2]}), 3);
    put(add(d4, rotate(d4, r, Vector<D4>{left[3], right[3], along[3]}), offset), 6);
    put(rotate(d4, r, Vector<D4>{along[0], along[1], along[2]}), 9);
  }

  /// Four copies of the edges of a group, one in each block.
  static HWY_INLINE Vector<D> in_blocks(const Group& edges_of_b, std::size_t k) {
    return {hn::LoadDup128(d, edges_of_b.value[k]), hn::LoadDup128(d, edges_of_b.value[k + 1]),
            hn::LoadDup128(d, edges_of_b.value[k + 2])};
  }

  void test_tiles(std::size_t i) {
    const RotationMatrix<float> matrix = pairs_.placed.rotation_of(i);
    Rotation<D4> r;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) r.m[k][j] = hn::Set(d4, matrix.m[k][j]);
    }
    const Vec3f o = pairs_.placed.offset_of(i);
    const Vector<D4> offset{hn::Set(d4, o.x), hn::Set(d4, o.y), hn::Set(d4, o.z)};
    Group groups[max_listed / 4];
    for (std::size_t b = 0; b < count_[1][i]; b += 4) gather_group(i, b, r, offset, groups[b / 4]);
    const std::size_t chosen_before = chosen_count_;
    for (std::size_t a = 0; a < count_[0][i]; a += blocks) {
      for (std::size_t b = 0; b < count_[1][i]; b += 4) {
        test_tile(i, a, b, groups[b / 4]);
        if (HWY_UNLIKELY(tiles_ == max_tiles || chosen_count_ + lanes > max_chosen)) {
          left_over_ |= 1u << i;
          chosen_count_ = chosen_before;
          return;
        }
      }
    }
    // Several groups of edges of the second hull: the pairs of an edge of the first are not in one tile.
    if (count_[1][i] > 4) std::sort(chosen_ + chosen_before, chosen_ + chosen_count_);
    pairs_.work.pass<float>(count_[0][i] * count_[1][i]);
  }

  HWY_INLINE void test_tile(std::size_t i, std::size_t a, std::size_t b, const Group& edges_of_b) {
    const geometry::HullEdge* const edges = hull(0, i).edges().data();
    const std::uint16_t* const list = list_[0][i];
    const std::size_t last = count_[0][i] - 1;
    const auto row = [&](std::size_t k) HWY_ATTR {
      return join_rows(
          d, [&](std::size_t lane) { return &edges[list[std::min(a + lane / 4, last)]].left_normal.x + 4 * k; }, 0);
    };
    const V left_row = row(0), right_row = row(1), along_row = row(2);
    const auto of_row = [&](V v) HWY_ATTR {
      return Vector<D>{hn::Broadcast<0>(v), hn::Broadcast<1>(v), hn::Broadcast<2>(v)};
    };
    const Vector<D> left_a = of_row(left_row), right_a = of_row(right_row), along_a = of_row(along_row);
    const Vector<D> from_a{hn::Broadcast<3>(left_row), hn::Broadcast<3>(right_row), hn::Broadcast<3>(along_row)};
    const Vector<D> along_b = in_blocks(edges_of_b, 9);
    const V p = dot(d, in_blocks(edges_of_b, 0), along_a), q = dot(d, in_blocks(edges_of_b, 3), along_a);
    const V r = dot(d, left_a, along_b), s = dot(d, right_a, along_b);
    const V forward = hn::Min(hn::Min(hn::Neg(p), q), hn::Min(hn::Neg(r), s));
    const V backward = hn::Min(hn::Min(p, hn::Neg(q)), hn::Min(r, hn::Neg(s)));
    const V crossing = hn::Max(forward, backward);
    const auto turn = hn::Lt(forward, backward);
    const Vector<D> across = cross(d, along_b, along_a), gap = subtract(d, from_a, in_blocks(edges_of_b, 6));
    const V sine_squared = dot(d, across, across), height = dot(d, across, gap);
    const V value = hn::IfThenElse(turn, hn::Neg(height), height);
    const float best = pairs_.best[i];
    const auto better = hn::Lt(value * hn::Abs(value), hn::Set(d, best * best) * sine_squared);
    const auto crosses = hn::Gt(crossing, hn::Set(d, -Rounding<float>::miss));
    const auto has_direction = hn::Gt(sine_squared, hn::Set(d, Rounding<float>::parallel_sine_squared));
    const std::uint32_t of_a = first_bits(4 * (count_[0][i] - a)),
                        of_b = 0x1111 * first_bits(std::min<std::size_t>(count_[1][i] - b, 4));
    std::uint32_t bits = bits_of(d, hn::And(hn::And(crosses, better), has_direction)) & of_a & of_b;
    if (bits == 0) return;
    Tile& tile = tile_[tiles_];
    hn::Store(hn::IfThenElse(turn, hn::Neg(across.x), across.x), d, tile.across[0]);
    hn::Store(hn::IfThenElse(turn, hn::Neg(across.y), across.y), d, tile.across[1]);
    hn::Store(hn::IfThenElse(turn, hn::Neg(across.z), across.z), d, tile.across[2]);
    hn::Store(gap.x, d, tile.gap[0]);
    hn::Store(gap.y, d, tile.gap[1]);
    hn::Store(gap.z, d, tile.gap[2]);
    hn::Store(sine_squared, d, tile.sine_squared);
    hn::Store(crossing, d, tile.crossing);
    hn::Store(value, d, tile.value);
    const std::size_t tile_index = tiles_++;
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      chosen_[chosen_count_++] = Chosen::of(i, a + lane / 4, b + lane % 4, tile_index, lane);
    }
  }

  /// An edge pair that is better than the best face, as a number that orders them: the pair of hulls, the positions of
  /// the edges in their lists, then where it is.
  struct Chosen {
    std::uint64_t bits;
    static Chosen of(std::size_t i, std::size_t a, std::size_t b, std::size_t tile, std::size_t lane) {
      return {std::uint64_t{i} << 48 | std::uint64_t{a} << 32 | std::uint64_t{b} << 16 | tile << 8 | lane};
    }
    std::uint32_t pair_and_edge() const { return static_cast<std::uint32_t>(bits >> 32); }
    std::size_t pair() const { return bits >> 48; }
    std::size_t tile() const { return bits >> 8 & 0xff; }
    std::size_t lane() const { return bits & 0xff; }
    bool operator<(const Chosen& other) const { return bits < other.bits; }
  };

  void evaluate_chosen() {
    std::uint32_t row = ~0u;
    float best_before_row = 0;
    for (std::size_t k = 0; k < chosen_count_; ++k) {
      const Chosen chosen = chosen_[k];
      const std::size_t i = chosen.pair(), lane = chosen.lane();
      const Tile& tile = tile_[chosen.tile()];
      // As in PolytopePair: one limit for all edge pairs with the same edge of the first hull.
      best_before_row = chosen.pair_and_edge() != row ? pairs_.best[i] : best_before_row;
      row = chosen.pair_and_edge();
      const float sine_squared = tile.sine_squared[lane], scaled = tile.value[lane];
      const Vec3f across{tile.across[0][lane], tile.across[1][lane], tile.across[2][lane]};
      const Vec3f gap{tile.gap[0][lane], tile.gap[1][lane], tile.gap[2][lane]};
      ++pairs_.work.directions;
      const Vec3f direction = across * (1.0f / std::sqrt(sine_squared));
      float value = dot(direction, gap);
      if (pairs_.best[i] < 0 || !(scaled * std::abs(scaled) < (best_before_row * best_before_row) * sine_squared) ||
          !(value < pairs_.best[i])) {
        continue;
      }
      const bool sure =
          tile.crossing[lane] > Rounding<float>::sure && sine_squared > Rounding<float>::sure_sine_squared;
      if (!(sure && value >= 0)) value = pairs_.overlap_along(i, direction);
      if (value < pairs_.best[i]) {
        pairs_.best[i] = value;
        pairs_.best_direction[0][i] = direction.x;
        pairs_.best_direction[1][i] = direction.y;
        pairs_.best_direction[2][i] = direction.z;
      }
    }
    chosen_count_ = tiles_ = 0;
  }

  HullPairs& pairs_;
  HullBounds& bounds_;
  std::uint32_t left_over_ = 0;
  std::size_t tiles_ = 0, chosen_count_ = 0;
  const std::uint16_t* list_[2][block_pairs];
  std::size_t count_[2][block_pairs];
  std::uint16_t pool_[2 * block_pairs * max_listed + max_edges + edge_list_slack];
  Chosen chosen_[max_chosen];
  Tile tile_[max_tiles];
};

#endif

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
