// The edges in the test of a box and a hull, for a block of pairs. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_BOX_HULL_EDGES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_HULL_EDGES_INL
#undef RINGFENCE_NARROW_PHASE_BOX_HULL_EDGES_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_HULL_EDGES_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/prefetch.hpp"
#include "narrow_phase/hull/box_hull_pairs-inl.hpp"
#include "narrow_phase/hull/hull_edges-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Finds the directions across an edge of each shape that have less overlap than all faces, and removes the pairs that
/// such a direction separates.
///
/// An edge of the hull crosses an edge of the box along axis k exactly where the normals of its two faces differ in the
/// sign of coordinate k. The ball inside the box and two of its corners exclude all but a few edges of the hull. The
/// overlap across the others is computed in lanes: one edge per lane, and the edges of a vector can belong to different
/// pairs of the block.
class BoxHullEdges {
 public:
  explicit BoxHullEdges(BoxHullPairs& pairs) : pairs_(pairs) {}

  void run() {
    for (std::size_t i = 0; i < pairs_.count; i += lanes) place_points(i);
    if constexpr (columns_in_one_vector) {
      std::copy_n(pairs_.best, block_pairs, best_of_faces_);
    } else {
      for (std::size_t u = 0; u < pairs_.undecided.count; ++u) copy_rows(pairs_.undecided.pair[u]);
    }
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) mark_faces(pairs_.undecided.pair[u]);
    std::uint32_t items[room + edge_list_slack];
    std::size_t count = 0;
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::size_t i = pairs_.undecided.pair[u];
      if (count + pairs_.hull[i]->edge_count() > room) {
        evaluate_edges(items, count);
        count = 0;
      }
      pairs_.work.pass<float>(pairs_.hull[i]->face_count());
      const std::size_t added = list_edges(i, items + count);
      prefetch_edges(items + count, added);
      count += added;
    }
    evaluate_edges(items, count);
    pairs_.undecided.keep([&](std::size_t i) { return (pairs_.doubtful >> i & 1) != 0 || pairs_.best[i] >= 0; });
  }

 private:
  using D = BoxHullPairs::D;
  using V = BoxHullPairs::V;
  using Column3 = BoxHullPairs::Column3;
  static constexpr D d{};
  static constexpr std::size_t lanes = BoxHullPairs::lanes;
  static constexpr std::size_t room = 1024;
  /// Whether one vector holds a number for each pair of the block: it is looked up by one instruction.
  static constexpr bool columns_in_one_vector = lanes == block_pairs;

  /// An edge of a hull that may have less overlap than all faces: the pair's index in the block in the upper 16 bits,
  /// the edge in the lower 16.
  struct Item {
    static constexpr int edge_bits = 16;
    std::uint32_t pair_and_edge;
    std::size_t pair() const { return pair_and_edge >> edge_bits; }
    std::size_t edge() const { return pair_and_edge & 0xffff; }
  };

  static constexpr std::uint8_t beyond = (1 << BoxHullPairs::sign_bit) - 1, signs = 7 << BoxHullPairs::sign_bit;

  /// Whether neither the ball nor a corner excludes an edge, and the edge crosses an edge of the box along some axis.
  /// `left` and `right` are the bytes of its two faces.
  struct RelevantEdge {
    HWY_INLINE bool operator()(std::uint8_t left, std::uint8_t right) const {
      return (left & right & beyond) == 0 && ((left ^ right) & signs) != 0;
    }
#if HWY_TARGET != HWY_SCALAR
    template <class B>
    HWY_INLINE hn::Mask<B> operator()(B b, hn::Vec<B> left, hn::Vec<B> right) const {
      const auto zero_bytes = hn::Zero(b);
      const auto together = hn::And(hn::And(left, right), hn::Set(b, beyond));
      const auto differ = hn::And(hn::Xor(left, right), hn::Set(b, signs));
      return hn::And(hn::Eq(together, zero_bytes), hn::Ne(differ, zero_bytes));
    }
#endif
  };

  /// Computes the points of the boxes that exclude edges, in the axes of the hulls: the centre, the corner deepest
  /// along the best direction, and the corner farthest along the line between the centres.
  HWY_INLINE void place_points(std::size_t i) {
    const Rotation<D> r = pairs_.placed.rotation_lanes(d, i);
    const Vector<D> offset = pairs_.placed.offset_lanes(d, i), half = pairs_.half_lanes(i);
    const auto in_hull = [&](const Vector<D>& p) HWY_ATTR { return unrotate(d, r, subtract(d, p, offset)); };
    const auto corner = [&](const Vector<D>& along) HWY_ATTR {
      return Vector<D>{hn::CopySign(half.x, along.x), hn::CopySign(half.y, along.y), hn::CopySign(half.z, along.z)};
    };
    const Vector<D> axis{hn::LoadU(d, pairs_.placed.axis(0) + i), hn::LoadU(d, pairs_.placed.axis(1) + i),
                         hn::LoadU(d, pairs_.placed.axis(2) + i)};
    store(d, negate(d, unrotate(d, r, offset)), point_[0], i);
    // Along the normal of a face of the box, four corners are deepest: the one most unlike the other corner is chosen.
    const auto or_else = [&](V along, V other)
                             HWY_ATTR { return hn::IfThenElse(hn::Eq(along, hn::Zero(d)), hn::Neg(other), along); };
    const Vector<D> best = load(d, pairs_.best_direction, i);
    store(d, in_hull(corner({or_else(best.x, axis.x), or_else(best.y, axis.y), or_else(best.z, axis.z)})), point_[1],
          i);
    store(d, in_hull(corner(axis)), point_[2], i);
    const V most = hn::Load(d, pairs_.best + i) + hn::Set(d, Rounding<float>::overlap) * hn::Load(d, pairs_.size + i);
    const V ball = hn::Min(hn::Min(half.x, half.y), half.z);
    hn::Store(most, d, of_corner_ + i);
    hn::Store(hn::Max(most - ball, hn::Zero(d)), d, of_ball_ + i);
  }

  /// Copies what evaluate_vector() reads for each pair.
  HWY_INLINE void copy_rows(std::size_t i) {
    const PlacementColumns& placed = pairs_.placed;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) rows_[i][k][j] = placed.second_to_first(k, j)[i];
      rows_[i][k][3] = placed.offset(k)[i];
      rows_[i][3][k] = placed.first_size(k)[i];
    }
    rows_[i][3][3] = pairs_.best[i];
  }

  /// Adds to the byte of each face of one hull one bit for the ball of the box and one for each corner: set if it is
  /// too deep. Along each normal of the arc between an edge's two faces, the overlap is at least the depth of any point
  /// of the box below the plane of support. If this depth is at least 0 at both ends of the arc, it is nowhere on the
  /// arc less than the lesser of these two values. So a point that is too deep for both faces excludes the edge.
  HWY_INLINE void mark_faces(std::size_t i) {
    std::uint8_t* const out = pairs_.face_bytes[i];
    mark_deep_points(*pairs_.hull[i], {at(point_[0], i), at(point_[1], i), at(point_[2], i)},
                     {of_ball_[i], of_corner_[i], of_corner_[i]},
                     [&](const FaceBytes& bytes, std::size_t f) HWY_ATTR { bytes.add_to(out + f); });
  }

  /// Lists the edges of one hull that no point excludes and returns their number. `out` has room for all edges of the
  /// hull and edge_list_slack more.
  HWY_INLINE std::size_t list_edges(std::size_t i, std::uint32_t* out) const {
    return list_edges_where(polytope_of(*pairs_.hull[i]), pairs_.face_bytes[i], RelevantEdge(),
                            static_cast<std::uint32_t>(i << Item::edge_bits), out);
  }

  /// The edges of all hulls together are larger than the first-level cache, and few of them are read.
  HWY_INLINE void prefetch_edges(const std::uint32_t* items, std::size_t count) const {
    for (std::size_t k = 0; k < count; ++k) {
      const Item item{items[k]};
      base::prefetch_for_read(&pairs_.hull[item.pair()]->edges()[item.edge()]);
    }
  }

  void evaluate_edges(std::uint32_t* items, std::size_t count) {
    for (std::size_t begin = 0; begin < count; begin += lanes)
      evaluate_vector(items + begin, std::min(lanes, count - begin));
  }

  void evaluate_vector(const std::uint32_t* items, std::size_t count) {
    const float *edge[lanes], *pair[lanes];
    alignas(64) std::int32_t index[lanes];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const Item item{items[lane < count ? lane : 0]};
      edge[lane] = &pairs_.hull[item.pair()]->edges()[item.edge()].left_normal.x;
      pair[lane] = rows_[item.pair()][0];
      index[lane] = static_cast<std::int32_t>(item.pair());
    }
    pairs_.work.lanes += lanes;
    pairs_.work.filled += count;
    pairs_.work.directions += count;
    V left[4], right[4], along[4], m[3][4], sizes[4];
    const auto gather = [&](const float* const* of, std::size_t k, V* out) HWY_ATTR {
      gather_rows(
          d, [&](std::size_t lane) { return of[lane] + 4 * k; }, out);
    };
    gather(edge, 0, left);
    gather(edge, 1, right);
    gather(edge, 2, along);
    if constexpr (columns_in_one_vector) {
      const auto indices = hn::SetTableIndices(d, index);
      const auto look_up = [&](const float* column)
                               HWY_ATTR { return hn::TableLookupLanes(hn::LoadU(d, column), indices); };
      for (int k = 0; k < 3; ++k) {
        for (int j = 0; j < 3; ++j) m[k][j] = look_up(pairs_.placed.second_to_first(k, j));
        m[k][3] = look_up(pairs_.placed.offset(k));
        sizes[k] = look_up(pairs_.placed.first_size(k));
      }
      sizes[3] = look_up(best_of_faces_);
    } else {
      for (std::size_t k = 0; k < 3; ++k) gather(pair, k, m[k]);
      gather(pair, 3, sizes);
    }
    V l[3], r[3], e[3], p[3];
    for (int k = 0; k < 3; ++k) {
      const auto to_box = [&](V x, V y, V z) HWY_ATTR { return m[k][0] * x + m[k][1] * y + m[k][2] * z; };
      l[k] = to_box(left[0], left[1], left[2]);
      r[k] = to_box(right[0], right[1], right[2]);
      e[k] = to_box(along[0], along[1], along[2]);
      p[k] = to_box(left[3], right[3], along[3]) + m[k][3];
    }
    const V zero = hn::Zero(d), none = hn::Set(d, 1e30f);
    V least = none, x = zero, y = zero, z = zero;
    auto doubtful = hn::Gt(zero, zero);
    const V e_squared[3] = {e[0] * e[0], e[1] * e[1], e[2] * e[2]};
    for (int k = 0; k < 3; ++k) {
      const int a = (k + 1) % 3, b = (k + 2) % 3;
      const auto crossing = hn::Lt(l[k] * r[k], zero);
      // The left normal rotates to the right normal about the edge, so the outward direction is axis k × edge or its
      // negative.
      const V height = e[a] * p[b] - e[b] * p[a];
      const auto flip = hn::Gt(l[k], zero);
      const V of_box = hn::Abs(e[b]) * sizes[a] + hn::Abs(e[a]) * sizes[b];
      const V sine_squared = e_squared[a] + e_squared[b];
      const auto has_direction = hn::Gt(sine_squared, hn::Set(d, Rounding<float>::parallel_sine_squared));
      const V inverse = hn::Set(d, 1.0f) / hn::Sqrt(hn::IfThenElse(has_direction, sine_squared, hn::Set(d, 1.0f)));
      const V overlap = (of_box + hn::IfThenElse(flip, hn::Neg(height), height)) * inverse;
      const auto evaluated = hn::And(crossing, has_direction);
      const auto sure = hn::And(hn::Gt(sine_squared, hn::Set(d, Rounding<float>::sure_sine_squared)),
                                hn::Gt(hn::Min(hn::Abs(l[k]), hn::Abs(r[k])), hn::Set(d, Rounding<float>::sure)));
      const auto better = hn::And(evaluated, hn::Lt(overlap, sizes[3]));
      doubtful = hn::Or(doubtful, hn::AndNot(sure, better));
      const auto less = hn::And(better, hn::Lt(overlap, least));
      least = hn::IfThenElse(less, overlap, least);
      // The direction from the box to the hull is the negative of the hull's outward direction.
      const V scale = hn::IfThenElse(flip, inverse, hn::Neg(inverse));
      V* const out[3] = {&x, &y, &z};
      *out[k] = hn::IfThenElse(less, zero, *out[k]);
      *out[a] = hn::IfThenElse(less, hn::Neg(e[b]) * scale, *out[a]);
      *out[b] = hn::IfThenElse(less, e[a] * scale, *out[b]);
    }
    alignas(64) float overlap[lanes], direction[3][lanes];
    hn::Store(least, d, overlap);
    hn::Store(x, d, direction[0]);
    hn::Store(y, d, direction[1]);
    hn::Store(z, d, direction[2]);
    std::uint32_t in_doubt = bits_of(d, doubtful) & first_bits(count);
    for (; in_doubt != 0; in_doubt &= in_doubt - 1)
      pairs_.doubtful |= 1u << Item{items[__builtin_ctz(in_doubt)]}.pair();
    std::uint32_t better = bits_of(d, hn::Lt(least, none)) & first_bits(count);
    for (; better != 0; better &= better - 1) {
      const auto lane = static_cast<std::size_t>(__builtin_ctz(better));
      const std::size_t i = Item{items[lane]}.pair();
      if (overlap[lane] >= pairs_.best[i]) continue;
      pairs_.best[i] = overlap[lane];
      for (int k = 0; k < 3; ++k) pairs_.best_direction[k][i] = direction[k][lane];
    }
  }

  BoxHullPairs& pairs_;
  // Points of the box in the axes of the hull, and how deep below a face the corners and the centre exclude it.
  alignas(64) Column3 point_[3];
  alignas(64) float of_corner_[block_pairs], of_ball_[block_pairs];
  alignas(64) float best_of_faces_[block_pairs];
  // For each pair three rows with a row of the rotation and a component of the offset each; then a row with the half
  // extents of the box and the least overlap of all faces.
  alignas(64) float rows_[block_pairs][4][4];
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
