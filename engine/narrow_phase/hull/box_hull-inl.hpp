// Boxes against hulls, in blocks of pairs. Included once for each Highway target.
//
// The least overlap is along the normal of a face of the box, the normal of a face of the hull, or a direction across
// one edge of each shape whose arcs of normals cross (as for any two polytopes: see polytope_pair-inl.hpp). But the
// support of a box needs no search: it is |n| · half extents in the box's own axes. So the overlap along all face
// normals of both shapes is computed exactly. An edge of the hull crosses an edge of the box along axis k exactly where
// the normals of its two faces differ in the sign of coordinate k. The ball inside the box and two of its corners
// exclude all but a few of these edges. The overlap across the remaining edges is computed in lanes: one edge per lane,
// and the edges of a vector can belong to different pairs of the block.
//
// PolytopePair tests a pair again, alone, where rounding could decide wrongly: edges are nearly parallel, arcs nearly
// miss each other, the depth differs from the least overlap, or the contact point lies outside a shape.

#if defined(RINGFENCE_NARROW_PHASE_BOX_HULL_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_HULL_INL
#undef RINGFENCE_NARROW_PHASE_BOX_HULL_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_HULL_INL
#endif

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "geometry/max_lanes-inl.hpp"
#include "narrow_phase/hull/hull_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Up to block_pairs pairs of a box and a hull, at least one. Everything is in the axes of the box, relative to its
/// centre.
class BoxHullBlock {
 public:
  BoxHullBlock(const KernelInput& input, const KernelPair* pairs, std::size_t count, WorkCounts& work)
      : input_(input), count_(count), work_(work) {
    std::fill(std::copy_n(pairs, count, pairs_), pairs_ + block_pairs, pairs[count - 1]);
    placed_.fill<ShapeKind::box, ShapeKind::hull>(input, pairs_, block_pairs);
    for (std::size_t i = 0; i < count; ++i) {
      hull_[i] = &input.shapes.hull(input.shapes.row(input.bodies[pairs_[i].second].shape).index_in_kind);
    }
  }

  /// Writes the contacts and returns the end of what it wrote.
  PairContact* test(PairContact* out) {
    test_centre_axis();
    try_faces();
    choose_faces();
    try_edges();
    compute_contacts();
    return write_block<KindsOf<ShapeKind::box, ShapeKind::hull>>(d, pairs_, count_, placed_, found_, out);
  }

 private:
  using D = Columns16<float>;
  using V = hn::Vec<D>;
  static constexpr D d{};
  static constexpr std::size_t lanes = hn::MaxLanes(D());
  using Column3 = float[3][block_pairs];

  HWY_INLINE V half(int k, std::size_t i) const { return hn::LoadU(d, placed_.first_size(k) + i); }
  HWY_INLINE V offset(int k, std::size_t i) const { return hn::LoadU(d, placed_.offset(k) + i); }
  HWY_INLINE V spread(const float* column, std::size_t i) const { return hn::Set(d, column[i]); }
  HWY_INLINE float size(std::size_t i) const { return size_[i]; }

  /// Rotates vectors from the axes of one hull to those of its box. Each lane is one face or vertex of the hull.
  struct RotationLanes {
    V m[3][3];
    HWY_INLINE V operator()(int k, V x, V y, V z) const { return m[k][0] * x + m[k][1] * y + m[k][2] * z; }
  };
  HWY_INLINE RotationLanes rotated(std::size_t i) const {
    RotationLanes t;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) t.m[k][j] = spread(placed_.second_to_first(k, j), i);
    }
    return t;
  }

  /// Removes the pairs that the line between the centres separates: most pairs that are apart.
  void test_centre_axis() {
    alignas(64) float rest[block_pairs];
    for (std::size_t i = 0; i < block_pairs; i += lanes) {
      V overlap = hn::Neg(hn::LoadU(d, placed_.along_axis() + i));
      for (int k = 0; k < 3; ++k) overlap = overlap + hn::Abs(hn::LoadU(d, placed_.axis(k) + i)) * half(k, i);
      hn::Store(overlap, d, rest + i);
    }
    undecided_.count = count_;
    for (std::size_t i = 0; i < count_; ++i) undecided_.pair[i] = static_cast<std::uint32_t>(i);
    undecided_.keep([&](std::size_t i) HWY_ATTR {
      const geometry::Hull& hull = *hull_[i];
      const float* const columns[3] = {hull.x(), hull.y(), hull.z()};
      const float overlap = -farthest_of<float>(columns, hull.vertex_count(), -placed_.axis_in_second(i)).value();
      ++work_.directions;
      work_.pass<float>(hull.vertex_count());
      return rest[i] + overlap >= 0;
    });
  }

  /// Computes the exact overlap along the normals of the hull's faces and keeps the least. Also computes the extent of
  /// the hull along the axes of the box.
  void try_faces() {
    for (std::size_t u = 0; u < undecided_.count; ++u) {
      const std::size_t i = undecided_.pair[u];
      const geometry::Hull& hull = *hull_[i];
      const RotationLanes to_box = rotated(i);
      const V h[3] = {spread(placed_.first_size(0), i), spread(placed_.first_size(1), i),
                      spread(placed_.first_size(2), i)};
      const V t[3] = {spread(placed_.offset(0), i), spread(placed_.offset(1), i), spread(placed_.offset(2), i)};
      const auto overlap = [&](std::size_t f) HWY_ATTR {
        const V x = hn::Load(d, hull.normal_x() + f), y = hn::Load(d, hull.normal_y() + f),
                z = hn::Load(d, hull.normal_z() + f);
        const V n[3] = {to_box(0, x, y, z), to_box(1, x, y, z), to_box(2, x, y, z)};
        return ((hn::Abs(n[0]) * h[0] + hn::Abs(n[1]) * h[1]) + hn::Abs(n[2]) * h[2]) +
               (hn::Load(d, hull.offset() + f) + ((n[0] * t[0] + n[1] * t[1]) + n[2] * t[2]));
      };
      Least<float> least(overlap(0));
      for (std::size_t f = lanes; f < hull.face_count(); f += lanes) least.add(overlap(f), f);

      const auto vertex = [&](int k, std::size_t v) HWY_ATTR {
        return to_box(k, hn::Load(d, hull.x() + v), hn::Load(d, hull.y() + v), hn::Load(d, hull.z() + v));
      };
      V low[3], high[3];
      for (int k = 0; k < 3; ++k) low[k] = high[k] = vertex(k, 0);
      for (std::size_t v = lanes; v < hull.vertex_count(); v += lanes) {
        for (int k = 0; k < 3; ++k) {
          const V along = vertex(k, v);
          low[k] = hn::Min(low[k], along);
          high[k] = hn::Max(high[k], along);
        }
      }
      float first[4], second[4];
      geometry::HWY_NAMESPACE::max_lanes_of_four(d, high[0], high[1], high[2], hn::Neg(low[0]), first);
      geometry::HWY_NAMESPACE::max_lanes_of_four(d, hn::Neg(low[1]), hn::Neg(low[2]), low[0], low[0], second);
      const float below[3] = {first[3], second[0], second[1]};
      const std::size_t face = least.index();
      const Vec3f normal = rotate(rotation_of(i), hull.normal(face));
      const float outward[3] = {normal.x, normal.y, normal.z};
      for (int k = 0; k < 3; ++k) {
        above_[k][i] = first[k];
        below_[k][i] = below[k];
        direction_[k][i] = -outward[k];
      }
      best_[i] = least.value();
      size_[i] = input_.shapes.row(input_.bodies[pairs_[i].first].shape).bounding_radius + hull.bounding_radius();
      work_.directions += hull.face_count() + 6;
      work_.pass<float>(hull.face_count());
      work_.pass<float>(hull.vertex_count());
    }
  }

  HWY_INLINE RotationMatrix<float> rotation_of(std::size_t i) const {
    RotationMatrix<float> r;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) r.m[k][j] = placed_.second_to_first(k, j)[i];
    }
    return r;
  }

  /// Chooses the face of either shape with the least overlap, and the corner of the box that is deepest along that
  /// face's normal. Removes the pairs that the face separates.
  void choose_faces() {
    for (std::size_t i = 0; i < count_; i += lanes) {
      V best = hn::Load(d, best_ + i);
      Vector<D> direction = load(d, direction_, i);
      V* const along[3] = {&direction.x, &direction.y, &direction.z};
      const auto consider = [&](int k, V overlap, float sign) HWY_ATTR {
        const auto less = hn::Lt(overlap, best);
        best = hn::Min(overlap, best);
        for (int j = 0; j < 3; ++j) *along[j] = hn::IfThenElse(less, hn::Set(d, j == k ? sign : 0.0f), *along[j]);
      };
      for (int k = 0; k < 3; ++k) {
        consider(k, (half(k, i) + hn::Load(d, below_[k] + i)) - offset(k, i), 1.0f);
        consider(k, (half(k, i) + hn::Load(d, above_[k] + i)) + offset(k, i), -1.0f);
      }
      hn::Store(best, d, best_ + i);
      store(d, direction, direction_, i);
      for (int k = 0; k < 3; ++k) {
        hn::Store(offset(k, i) - hn::CopySign(half(k, i), *along[k]), d, from_corner_[k] + i);
      }
    }
    undecided_.keep([&](std::size_t i) { return best_[i] >= 0; });
    for (std::size_t u = 0; u < undecided_.count; ++u) {
      const std::size_t i = undecided_.pair[u];
      for (int k = 0; k < 3; ++k) {
        for (int j = 0; j < 3; ++j) rows_[i][k][j] = placed_.second_to_first(k, j)[i];
        rows_[i][k][3] = placed_.offset(k)[i];
        rows_[i][3][k] = placed_.first_size(k)[i];
      }
      rows_[i][3][3] = best_[i];
    }
  }

  /// An edge of a hull that may have less overlap than all faces: the pair's index in the block in the upper 16 bits,
  /// the edge in the lower 16.
  struct Item {
    static constexpr int edge_bits = 16;
    std::uint32_t pair_and_edge;
    std::size_t pair() const { return pair_and_edge >> edge_bits; }
    std::size_t edge() const { return pair_and_edge & 0xffff; }
  };

  /// Bits of the byte of a face of the hull. `beyond`: the ball (1), the corner deepest along the best direction (2) or
  /// the corner farthest along the line between the centres (4) is too deep. `signs`: the coordinate of its normal on
  /// axis 0, 1 or 2 is negative.
  static constexpr std::uint8_t beyond = 1 + 2 + 4, signs = 8 + 16 + 32;

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

  /// Lists the relevant edges of one pair's hull and returns their number. `out` has room for all edges of the hull and
  /// three more. Along each normal of the arc between an edge's two faces, the overlap is at least the depth of any
  /// point of the box below the plane of support. If this depth is at least 0 at both ends of the arc, it is nowhere on
  /// the arc less than the lesser of these two values. So a point that is too deep for both faces excludes the edge.
  std::size_t list_edges(std::size_t i, std::uint32_t* out) const {
    alignas(64) std::uint8_t bytes[max_faces];
    const geometry::Hull& hull = *hull_[i];
    const RotationLanes to_box = rotated(i);
    const V t[3] = {spread(placed_.offset(0), i), spread(placed_.offset(1), i), spread(placed_.offset(2), i)};
    const V c[3] = {spread(from_corner_[0], i), spread(from_corner_[1], i), spread(from_corner_[2], i)};
    V a[3];  // from the corner along the line between the centres
    for (int k = 0; k < 3; ++k) {
      a[k] = t[k] - hn::CopySign(spread(placed_.first_size(k), i), spread(placed_.axis(k), i));
    }
    const float limit = best_[i] + Rounding<float>::overlap * size_[i];
    const float ball = std::min(std::min(placed_.first_size(0)[i], placed_.first_size(1)[i]), placed_.first_size(2)[i]);
    const V of_corner = hn::Set(d, limit), of_ball = hn::Set(d, std::max(limit - ball, 0.0f)), zero = hn::Zero(d);
    for (std::size_t f = 0; f < hull.face_count(); f += lanes) {
      const V x = hn::Load(d, hull.normal_x() + f), y = hn::Load(d, hull.normal_y() + f),
              z = hn::Load(d, hull.normal_z() + f);
      const V n[3] = {to_box(0, x, y, z), to_box(1, x, y, z), to_box(2, x, y, z)};
      const V height = hn::Load(d, hull.offset() + f);
      const V to_centre = height + ((n[0] * t[0] + n[1] * t[1]) + n[2] * t[2]);
      const V to_corner = height + ((n[0] * c[0] + n[1] * c[1]) + n[2] * c[2]);
      auto byte = bit_where(d, hn::Ge(to_centre, of_ball), 0);
      byte = hn::Or(byte, bit_where(d, hn::Ge(to_corner, of_corner), 1));
      const V to_other = height + ((n[0] * a[0] + n[1] * a[1]) + n[2] * a[2]);
      byte = hn::Or(byte, bit_where(d, hn::Ge(to_other, of_corner), 2));
      for (int k = 0; k < 3; ++k) byte = hn::Or(byte, bit_where(d, hn::Lt(n[k], zero), 3 + k));
      store_bytes(hn::RebindToSigned<D>(), byte, bytes + f);
    }
    return list_edges_where(polytope_of(hull), bytes, RelevantEdge(), static_cast<std::uint32_t>(i << Item::edge_bits),
                            out);
  }

  void try_edges() {
    constexpr std::size_t room = 1024;
    std::uint32_t items[room + 4];
    std::size_t count = 0;
    for (std::size_t u = 0; u < undecided_.count; ++u) {
      const std::size_t i = undecided_.pair[u];
      if (count + hull_[i]->edge_count() > room) {
        evaluate_edges(items, count);
        count = 0;
      }
      work_.pass<float>(hull_[i]->face_count());
      count += list_edges(i, items + count);
    }
    evaluate_edges(items, count);
  }

  void evaluate_edges(std::uint32_t* items, std::size_t count) {
    for (std::size_t begin = 0; begin < count; begin += lanes)
      evaluate_vector(items + begin, std::min(lanes, count - begin));
  }

  void evaluate_vector(const std::uint32_t* items, std::size_t count) {
    const float *edge[lanes], *pair[lanes];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const Item item{items[lane < count ? lane : 0]};
      edge[lane] = &hull_[item.pair()]->edges()[item.edge()].left_normal.x;
      pair[lane] = rows_[item.pair()][0];
    }
    work_.lanes += lanes;
    work_.filled += count;
    work_.directions += count;
    V left[4], right[4], along[4], m[3][4], sizes[4];
    const auto gather = [&](const float* const* of, std::size_t k, V* out) HWY_ATTR {
      gather_rows(
          d, [&](std::size_t lane) { return of[lane] + 4 * k; }, out);
    };
    gather(edge, 0, left);
    gather(edge, 1, right);
    gather(edge, 2, along);
    for (std::size_t k = 0; k < 3; ++k) gather(pair, k, m[k]);
    gather(pair, 3, sizes);
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
    for (; in_doubt != 0; in_doubt &= in_doubt - 1) doubtful_mask_ |= 1u << Item{items[__builtin_ctz(in_doubt)]}.pair();
    std::uint32_t better = bits_of(d, hn::Lt(least, none)) & first_bits(count);
    for (; better != 0; better &= better - 1) {
      const auto lane = static_cast<std::size_t>(__builtin_ctz(better));
      const std::size_t i = Item{items[lane]}.pair();
      if (overlap[lane] >= best_[i]) continue;
      best_[i] = overlap[lane];
      for (int k = 0; k < 3; ++k) direction_[k][i] = direction[k][lane];
    }
  }

  /// Computes depth and point along the best directions.
  void compute_contacts() {
    undecided_.keep([&](std::size_t i) { return (doubtful_mask_ >> i & 1) != 0 || best_[i] >= 0; });
    alignas(64) float of_box[block_pairs], to_hull[block_pairs], slack[block_pairs];
    alignas(64) Column3 in_hull, corner;
    alignas(64) std::uint32_t flat[3][block_pairs];
    for (std::size_t i = 0; i < count_; i += lanes) {
      Vector<D> n = load(d, direction_, i);
      n = scale(d, n, hn::Set(d, 1.0f) / hn::Sqrt(dot(d, n, n)));
      store(d, n, direction_, i);
      Rotation<D> to_box;
      for (int k = 0; k < 3; ++k) {
        for (int j = 0; j < 3; ++j) to_box.m[k][j] = hn::LoadU(d, placed_.second_to_first(k, j) + i);
      }
      store(d, negate(d, unrotate(d, to_box, n)), in_hull, i);
      const V parts[3] = {n.x, n.y, n.z};
      const V level = hn::Set(d, Rounding<float>::height) * hn::Load(d, size_ + i);
      hn::Store(level, d, slack + i);
      V height = hn::Zero(d);
      for (int k = 0; k < 3; ++k) {
        const V own = hn::Abs(parts[k]) * half(k, i);
        height = height + own;
        const hn::RebindToUnsigned<D> ints;
        hn::Store(hn::IfThenElseZero(hn::RebindMask(ints, hn::Le(own + own, level)), hn::Set(ints, 1)), ints,
                  flat[k] + i);
        hn::Store(hn::CopySign(half(k, i), parts[k]), d, corner[k] + i);
      }
      hn::Store(height, d, of_box + i);
      hn::Store((n.x * offset(0, i) + n.y * offset(1, i)) + n.z * offset(2, i), d, to_hull + i);
    }
    for (std::size_t u = 0; u < undecided_.count; ++u) {
      const std::size_t i = undecided_.pair[u];
      const Polytope hull = polytope_of(*hull_[i]);
      Feature<float> of_hull;
      find_feature<float>(hull, at(in_hull, i), slack[i], of_hull);
      const float depth = (of_box[i] + of_hull.height) - to_hull[i];
      if ((doubtful_mask_ >> i & 1) != 0 || depth > best_[i] + Rounding<float>::sure * (best_[i] + size_[i])) {
        test_single_pair(i);
        continue;
      }
      const Vec3f n = at(direction_, i);
      const std::uint32_t flats = flat[0][i] + flat[1][i] + flat[2][i];
      Vec3f point;
      if (of_hull.count == 1) {
        const Vec3f vertex = vertex_in_box(i, of_hull.first());
        if (flats > 0 && outside_box(i, vertex)) {
          test_single_pair(i);
          continue;
        }
        point = vertex + n * (depth * 0.5f);
      } else if (flats == 0) {
        const Vec3f vertex = at(corner, i);
        const Vec3f in_its_axes = rotate_inverse(rotation_of(i), vertex - at_offset(i));
        if (outside<float>(hull, in_its_axes, outside_tolerance(i))) {
          test_single_pair(i);
          continue;
        }
        point = vertex - n * (depth * 0.5f);
      } else {
        const std::uint32_t is_flat[3] = {flat[0][i], flat[1][i], flat[2][i]};
        point = shared_point(i, at(corner, i), is_flat, of_hull, n, of_box[i] - depth * 0.5f);
        // The point where two edges cross lies inside both shapes, so it needs no check.
        const bool cross = flats == 1 && of_hull.count == 2 && !nearly_parallel(i, of_hull);
        if (!cross &&
            (outside_box(i, point) ||
             outside<float>(hull, rotate_inverse(rotation_of(i), point - at_offset(i)), outside_tolerance(i)))) {
          test_single_pair(i);
          continue;
        }
      }
      found_.put(i, std::max(depth, 0.0f), n, point);
    }
  }

  HWY_INLINE Vec3f at_offset(std::size_t i) const {
    return {placed_.offset(0)[i], placed_.offset(1)[i], placed_.offset(2)[i]};
  }
  HWY_INLINE Vec3f vertex_in_box(std::size_t i, std::size_t vertex) const {
    return rotate(rotation_of(i), hull_[i]->vertex(vertex)) + at_offset(i);
  }
  HWY_INLINE float outside_tolerance(std::size_t i) const {
    return 2e-5f * std::min(input_.shapes.row(input_.bodies[pairs_[i].first].shape).bounding_radius,
                            hull_[i]->bounding_radius());
  }
  HWY_INLINE bool outside_box(std::size_t i, Vec3f p) const {
    const float most = outside_tolerance(i);
    return std::abs(p.x) > placed_.first_size(0)[i] + most || std::abs(p.y) > placed_.first_size(1)[i] + most ||
           std::abs(p.z) > placed_.first_size(2)[i] + most;
  }

  /// Whether an edge of the hull is parallel to an axis of the box within 0.01 radians.
  HWY_INLINE bool nearly_parallel(std::size_t i, const Feature<float>& of_hull) const {
    const Vec3f edge = vertex_in_box(i, of_hull.last()) - vertex_in_box(i, of_hull.first());
    const float longest = std::max(std::max(std::abs(edge.x), std::abs(edge.y)), std::abs(edge.z));
    return dot(edge, edge) < 1.0001f * longest * longest;
  }

  HWY_NOINLINE Vec3f shared_point(std::size_t i, Vec3f corner, const std::uint32_t is_flat[3],
                                  const Feature<float>& of_hull, Vec3f n, float height) const {
    FeaturePoints first, second;
    const auto x = [&](std::uint32_t sides) HWY_ATTR { return double{(sides & 1) != 0 ? -corner.x : corner.x}; };
    const auto y = [&](std::uint32_t sides) HWY_ATTR { return double{(sides & 2) != 0 ? -corner.y : corner.y}; };
    const auto z = [&](std::uint32_t sides) HWY_ATTR { return double{(sides & 4) != 0 ? -corner.z : corner.z}; };
    const std::uint32_t free = is_flat[0] | is_flat[1] << 1 | is_flat[2] << 2;
    for (std::uint32_t sides = 0; sides < 8; ++sides) {
      if ((sides & ~free) == 0) first.add({x(sides), y(sides), z(sides)});
    }
    for_each_in(of_hull.vertices, hull_[i]->vertex_count(),
                [&](std::size_t v) HWY_ATTR { second.add(to_double(vertex_in_box(i, v))); });
    const Vec3f common = to_float(common_point(first.get(), second.get(), to_double(n)));
    return common + n * (height - dot(n, common));
  }

  HWY_NOINLINE void test_single_pair(std::size_t i) {
    const BoxPolytope box(&input_.shapes.row(input_.bodies[pairs_[i].first].shape).size[0]);
    const Polytope hull = polytope_of(*hull_[i]);
    const Placement<float> placed = placed_.get(i);
    const std::size_t of_box = farthest_vertex<float>(box.polytope(), placed.axis);
    const std::size_t of_hull = farthest_vertex<float>(hull, -placed.axis_in_second);
    const float value = (support<float>(box.polytope(), placed.axis) + support<float>(hull, -placed.axis_in_second)) -
                        placed_.along_axis()[i];
    PolytopePair<float> pair(box.polytope(), hull, placed, {value, of_box, of_hull}, work_);
    Overlap<float> found;
    if (pair.test(found)) found_.put(i, found.depth, found.normal, found.point);
  }

  const KernelInput& input_;
  const std::size_t count_;
  WorkCounts& work_;
  KernelPair pairs_[block_pairs];
  PlacementColumns placed_;
  const geometry::Hull* hull_[block_pairs];
  Undecided undecided_;
  alignas(64) float best_[block_pairs] = {};  // the least overlap found
  // What evaluate_vector() reads for each pair: three rows with a row of the rotation and a component of the offset
  // each; then a row with the half extents of the box and the least overlap of all faces.
  alignas(64) float rows_[block_pairs][4][4];
  alignas(64) float size_[block_pairs] = {};  // the sum of the two bounding radii
  alignas(64) Column3 direction_ = {};        // the best direction, from box to hull, unit
  // The extent of the hull along the axes of the box, above and below the origin of the hull.
  alignas(64) Column3 above_ = {}, below_ = {};
  alignas(64) Column3 from_corner_ = {};  // from the box's deepest corner to the hull's origin
  std::uint32_t doubtful_mask_ = 0;       // one bit per pair: rounding could decide it wrongly
  BlockContacts found_;
};

inline PairContact* box_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  if (input.in_double) return run_in_double<BoxSource, HullSource>(input, out, counters);
  WorkCounts work;
  for (std::size_t begin = 0; begin < input.pairs.size(); begin += block_pairs) {
    begin_gathering(input);
    BoxHullBlock block(input, input.pairs.data() + begin, std::min(block_pairs, input.pairs.size() - begin), work);
    end_gathering(input);
    out = block.test(out);
  }
  work.add_to(counters);
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
