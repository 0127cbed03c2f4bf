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

#include "narrow_phase/hull/box_hull_bounds-inl.hpp"
#include "narrow_phase/hull/box_hull_pairs-inl.hpp"
#include "narrow_phase/hull/hull_edges-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Finds the directions across an edge of each shape that have less overlap than all faces, and removes the pairs that
/// such a direction separates.
///
/// An edge of the hull crosses an edge of the box along axis k exactly where the normals of its two faces differ in the
/// sign of coordinate k. The deepest corners of the box below these faces and the neighbours of these corners exclude
/// all but two of the edges of a hull that touches. The overlap across the others is computed in lanes: one edge per
/// lane, and the edges of a vector can belong to different pairs of the block.
class BoxHullEdges {
 public:
  BoxHullEdges(BoxHullPairs& pairs, BoxHullBounds& bounds) : pairs_(pairs), bounds_(bounds) {}

  void run() {
    if constexpr (columns_in_one_vector) {
      std::copy_n(pairs_.best, block_pairs, best_of_faces_);
    } else {
      for (std::size_t u = 0; u < pairs_.undecided.count; ++u) copy_rows(pairs_.undecided.pair[u]);
    }
    bounds_.limit_edges();
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::size_t i = pairs_.undecided.pair[u];
      bounds_.mark_faces(i, face_bytes_[i]);
    }
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) select_edges_of(pairs_.undecided.pair[u]);
    std::uint32_t items[room + max_edges + 4];
    std::size_t count = 0;
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) count = list_edges(pairs_.undecided.pair[u], items, count);
    evaluate_edges(items, count);
    pairs_.undecided.keep([&](std::size_t i) { return (pairs_.doubtful >> i & 1) != 0 || pairs_.best[i] >= 0; });
  }

 private:
  using D = BoxHullPairs::D;
  using V = BoxHullPairs::V;
  using Column3 = BoxHullPairs::Column3;
  static constexpr D d{};
  static constexpr std::size_t lanes = BoxHullPairs::lanes;
  static constexpr std::size_t room = 512;  ///< edges that are evaluated together
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

  /// Whether an edge can have less overlap than the best direction, by the bytes that BoxHullBounds::mark_faces() has
  /// written for its two faces.
  ///
  /// On the arc between the normals of the two faces, the overlap is at least the depth of any point of the box below
  /// the plane of support. If this depth is at least the best overlap at both ends of the arc, it is so on all of it,
  /// since it is linear in the direction. The deepest corner of each face is that deep, because no face is better than
  /// the best. If the signs of the normals differ in one coordinate only, the deepest corner of one face is the
  /// neighbour of that of the other: the edge is excluded where this neighbour is too deep for either face. If they
  /// differ in two coordinates, there are two corners between the deepest ones. Each is a neighbour of both, along one
  /// axis each, so the edge is excluded where one axis is too deep for the left face and the other one for the right
  /// face. Edges whose normals differ in all three signs are always evaluated: there are hardly any.
  ///
  /// A sign may be wrong where h_k·n_k is nearly zero. The corner on the other side is then nearly as deep, which the
  /// limits allow for. Faces that are as good as the best one within the errors have the right signs.
  struct RelevantEdge {
    static constexpr std::uint8_t axes = 7;
    static constexpr int deep_bit = 3;

    HWY_INLINE bool operator()(std::uint8_t left, std::uint8_t right) const {
      const unsigned crossed = (unsigned{left} ^ unsigned{right}) & axes,
                     of_left = crossed & unsigned{left} >> deep_bit, of_right = crossed & unsigned{right} >> deep_bit;
      const bool several = (crossed & (crossed - 1)) != 0, by_one_face = of_left == 0 || of_right == 0;
      return (crossed & ~(of_left | of_right)) != 0 || crossed == axes || (several && by_one_face);
    }
#if HWY_TARGET != HWY_SCALAR
    template <class B>
    HWY_INLINE hn::Mask<B> operator()(B b, hn::Vec<B> left, hn::Vec<B> right) const {
      const auto none = hn::Zero(b), all = hn::Set(b, axes);
      const hn::Repartition<std::uint16_t, B> pairs;
      // The bits that come from the other byte are not among those that are used.
      const auto deep = [&](hn::Vec<B> v)
                            HWY_ATTR { return hn::BitCast(b, hn::ShiftRight<deep_bit>(hn::BitCast(pairs, v))); };
      const auto crossed = hn::And(hn::Xor(left, right), all), of_left = deep(left), of_right = deep(right);
      const auto by_one_face =
          hn::Or(hn::Eq(hn::And(crossed, of_left), none), hn::Eq(hn::And(crossed, of_right), none));
      const auto several = hn::Ne(hn::And(crossed, hn::Sub(crossed, hn::Set(b, 1))), none);
      const auto open = hn::Ne(hn::AndNot(hn::Or(of_left, of_right), crossed), none);
      return hn::Or(hn::Or(open, hn::Eq(crossed, all)), hn::And(several, by_one_face));
    }
#endif
  };

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

  HWY_INLINE void select_edges_of(std::size_t i) {
    pairs_.work.pass<float>(pairs_.hull[i]->face_count());
    select_edges(polytope_of(*pairs_.hull[i]), face_bytes_[i], RelevantEdge(),
                 [&](std::uint64_t bits, std::size_t first) HWY_ATTR { selected_[i][first / 64] = bits; });
  }

  static HWY_INLINE std::uint32_t item(std::size_t i, std::size_t edge) {
    return static_cast<std::uint32_t>(i << Item::edge_bits | edge);
  }
  /// Appends the selected edges of one hull and returns the new count.
  HWY_INLINE std::size_t list_edges(std::size_t i, std::uint32_t* items, std::size_t count) {
    if (HWY_UNLIKELY(count >= room)) {
      evaluate_edges(items, count);
      count = 0;
    }
    for (std::size_t first = 0; first < pairs_.hull[i]->edge_count(); first += 64) {
      count = append_few_bits(selected_[i][first / 64], item(i, first), items, count);
    }
    return count;
  }

  void evaluate_edges(const std::uint32_t* items, std::size_t count) {
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
  BoxHullBounds& bounds_;
  std::uint64_t selected_[block_pairs][(max_edges + 63) / 64];  // one bit for each edge of each hull
  alignas(64) std::uint8_t face_bytes_[block_pairs][max_faces];
  alignas(64) float best_of_faces_[block_pairs];
  // For each pair three rows with a row of the rotation and a component of the offset each; then a row with the half
  // extents of the box and the least overlap of all faces.
  alignas(64) float rows_[block_pairs][4][4];
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
