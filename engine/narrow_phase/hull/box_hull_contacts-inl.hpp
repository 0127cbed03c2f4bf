// Depth and point along the best direction of a box and a hull, for a block of pairs. Included once for each Highway
// target.

#if defined(RINGFENCE_NARROW_PHASE_BOX_HULL_CONTACTS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_HULL_CONTACTS_INL
#undef RINGFENCE_NARROW_PHASE_BOX_HULL_CONTACTS_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_HULL_CONTACTS_INL
#endif

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/box_hull_pairs-inl.hpp"
#include "narrow_phase/hull/crossing_edges-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Computes the contacts of the undecided pairs of a block along their best directions.
///
/// What touches is a vertex of the hull, a corner of the box, or an edge of each; the points of all three are computed
/// in lanes, one pair per lane. All other features are tested one pair at a time, and pairs that rounding could decide
/// wrongly are tested again by PolytopePair: the depth differs from the least overlap, or the point lies outside a
/// shape.
class BoxHullContacts {
 public:
  BoxHullContacts(BoxHullPairs& pairs, BlockContacts& out) : pairs_(pairs), out_(out) {}

  void run() {
    compute_normals();
    // The lanes of decided pairs are computed too: leftovers on the stack could be slow to compute with.
    set_zero(vertex_);
    set_zero(part_);
    set_zero(depth_);
    set_zero(tolerance_);
    find_features();
    for (std::size_t i = 0; i < pairs_.count; i += lanes) compute_points(i);
    if (crossing_.count > 0) put_crossings();
    check_corners();
    for (std::size_t k = 0; k < others_.count; ++k) share_point(others_.pair[k]);
    for (std::size_t k = 0; k < doubtful_.count; ++k) test_alone(doubtful_.pair[k]);
  }

 private:
  using D = BoxHullPairs::D;
  using V = BoxHullPairs::V;
  using Column3 = BoxHullPairs::Column3;
  static constexpr D d{};
  static constexpr std::size_t lanes = BoxHullPairs::lanes;
  static constexpr hn::RebindToUnsigned<D> ids{};

  /// What of the hull is farthest along the direction.
  enum Part : std::uint32_t { none, vertex, edge, face };

  void compute_normals() {
    for (std::size_t i = 0; i < pairs_.count; i += lanes) {
      Vector<D> n = load(d, pairs_.best_direction, i);
      n = scale(d, n, hn::Set(d, 1.0f) / hn::Sqrt(dot(d, n, n)));
      store(d, n, out_.normal, i);
      store(d, negate(d, unrotate(d, pairs_.placed.rotation_lanes(d, i), n)), in_hull_, i);
      const V parts[3] = {n.x, n.y, n.z};
      const V level = hn::Set(d, Rounding<float>::height) * hn::Load(d, pairs_.size + i);
      hn::Store(level, d, slack_ + i);
      V height = hn::Zero(d);
      auto flats = hn::Zero(ids);
      for (int k = 0; k < 3; ++k) {
        const V own = hn::Abs(parts[k]) * pairs_.half(k, i);
        height = height + own;
        const auto flat = hn::RebindMask(ids, hn::Le(own + own, level));
        flats = hn::Or(flats, hn::IfThenElseZero(flat, hn::Set(ids, 1u << k)));
        hn::Store(hn::CopySign(pairs_.half(k, i), parts[k]), d, corner_[k] + i);
      }
      hn::Store(flats, ids, flats_ + i);
      hn::Store(height, d, of_box_ + i);
      hn::Store(dot(d, n, pairs_.placed.offset_lanes(d, i)), d, along_ + i);
    }
  }

  /// Finds the features of the hulls, without branches on what they are, which would be unpredictable.
  void find_features() {
    const std::uint32_t* const pair = pairs_.undecided.pair;
    for_each_greatest(
        pairs_.undecided.count, [&](std::size_t u) HWY_ATTR { return heights_of(pair[u]); },
        [&](std::size_t u, float most) { feature_[pair[u]].height = most; });
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) find_feature_of(pairs_.undecided.pair[u]);
  }

  /// Stores the distances of the vertices of a hull along the direction. Returns the greatest of each lane.
  HWY_INLINE V heights_of(std::uint32_t i) {
    const geometry::Hull& hull = *pairs_.hull[i];
    const auto direction = spread_out(d, at(in_hull_, i));
    const auto height = [&](std::size_t v) HWY_ATTR {
      const V heights = dot_of(d, read(d, hull.x() + v, hull.y() + v, hull.z() + v), direction);
      hn::Store(heights, d, heights_[i] + v);
      return heights;
    };
    V most = height(0);
    for (std::size_t v = lanes; v < hull.vertex_count(); v += lanes) most = hn::Max(most, height(v));
    return most;
  }

  HWY_INLINE void find_feature_of(std::uint32_t i) {
    const geometry::Hull& hull = *pairs_.hull[i];
    Feature<float>& feature = feature_[i];
    const V least = hn::Set(d, feature.height - slack_[i]);
    feature.count = collect(d, hull.vertex_count(), feature.vertices,
                            [&](std::size_t v) HWY_ATTR { return hn::Ge(hn::Load(d, heights_[i] + v), least); });
    const float depth = (of_box_[i] + feature.height) - along_[i];
    depth_[i] = depth;
    tolerance_[i] = 2e-5f * std::min(pairs_.box(i).bounding_radius, hull.bounding_radius());
    const bool deeper = depth > pairs_.best[i] + Rounding<float>::sure * (pairs_.best[i] + pairs_.size[i]);
    // There is a farthest vertex unless the direction is not a number.
    const bool doubtful = deeper | ((pairs_.doubtful >> i & 1) != 0) | (feature.count == 0);
    doubtful_.add(i, doubtful);
    if (HWY_UNLIKELY(feature.count == 0)) return;
    put(hull.vertex(feature.first()), vertex_[0], i);
    put(hull.vertex(feature.last(hull.vertex_count())), vertex_[1], i);
    part_[i] = static_cast<std::uint32_t>(std::min<std::size_t>(feature.count, face)) & (std::uint32_t{doubtful} - 1);
  }

  /// Computes the points of the pairs where a vertex or a corner touches, and collects those where two edges cross.
  HWY_INLINE void compute_points(std::size_t i) {
    const Rotation<D> r = pairs_.placed.rotation_lanes(d, i);
    const Vector<D> offset = pairs_.placed.offset_lanes(d, i), normal = load(d, out_.normal, i),
                    corner = load(d, corner_, i);
    const Vector<D> first = add(d, rotate(d, r, load(d, vertex_[0], i)), offset);
    const Vector<D> last = add(d, rotate(d, r, load(d, vertex_[1], i)), offset);
    store(d, unrotate(d, r, subtract(d, corner, offset)), corner_in_hull_, i);
    const V depth = hn::Load(d, depth_ + i), half_depth = depth * hn::Set(d, 0.5f);
    const Vector<D> to_middle = scale(d, normal, half_depth);

    const auto part = hn::Load(ids, part_ + i), flats = hn::Load(ids, flats_ + i), no_flats = hn::Zero(ids);
    const auto any = hn::Ne(part, hn::Set(ids, std::uint32_t{none}));
    const auto one_vertex = hn::Eq(part, hn::Set(ids, std::uint32_t{vertex}));
    const auto is_corner = hn::And(hn::AndNot(one_vertex, any), hn::Eq(flats, no_flats));
    const auto beside =
        hn::And(hn::And(one_vertex, hn::Ne(flats, no_flats)), hn::RebindMask(ids, outside_boxes(i, first)));
    const auto one_flat = hn::And(hn::Ne(flats, no_flats), hn::Eq(hn::And(flats, flats - hn::Set(ids, 1)), no_flats));
    const auto two_edges = hn::And(hn::And(hn::Eq(part, hn::Set(ids, std::uint32_t{edge})), one_flat),
                                   hn::Not(hn::RebindMask(ids, nearly_parallel(first, last))));

    out_.put_lanes(d, i, hn::RebindMask(d, hn::Or(hn::AndNot(beside, one_vertex), is_corner)),
                   hn::Max(depth, hn::Zero(d)),
                   choose(d, hn::RebindMask(d, one_vertex), add(d, first, to_middle), subtract(d, corner, to_middle)));
    const auto turned = [&](std::uint32_t k, V v) HWY_ATTR {
      const auto flat = hn::Ne(hn::And(flats, hn::Set(ids, 1u << k)), no_flats);
      return hn::IfThenElse(hn::RebindMask(d, flat), hn::Neg(v), v);
    };
    crossing_.add(d, hn::RebindMask(d, two_edges), i, normal, hn::Load(d, of_box_ + i) - half_depth, corner,
                  {turned(0, corner.x), turned(1, corner.y), turned(2, corner.z)}, first, last);
    others_.add_bits(bits_of(ids, hn::AndNot(hn::Or(hn::Or(one_vertex, is_corner), two_edges), any)), i);
    corners_.add_bits(bits_of(ids, is_corner), i);
    doubtful_.add_bits(bits_of(ids, beside), i);
  }

  HWY_INLINE hn::Mask<D> outside_boxes(std::size_t i, const Vector<D>& p) const {
    const V most = hn::Load(d, tolerance_ + i);
    return hn::Or(
        hn::Or(hn::Gt(hn::Abs(p.x), pairs_.half(0, i) + most), hn::Gt(hn::Abs(p.y), pairs_.half(1, i) + most)),
        hn::Gt(hn::Abs(p.z), pairs_.half(2, i) + most));
  }

  /// Whether an edge of the hull, given by its ends, is parallel to an axis of the box within 0.01 radians.
  static HWY_INLINE hn::Mask<D> nearly_parallel(const Vector<D>& first, const Vector<D>& last) {
    const Vector<D> along = subtract(d, last, first);
    const V longest = hn::Max(hn::Max(hn::Abs(along.x), hn::Abs(along.y)), hn::Abs(along.z));
    return hn::Lt(dot(d, along, along), hn::Set(d, 1.0001f) * longest * longest);
  }

  void put_crossings() {
    crossing_.compute();
    for (std::size_t k = 0; k < crossing_.count; ++k) {
      const std::uint32_t i = crossing_.pair[k];
      if (HWY_UNLIKELY(!crossing_.found(k))) {
        put_common_point(i);
        continue;
      }
      out_.put(i, std::max(depth_[i], 0.0f), at(out_.normal, i), crossing_.at(k));
    }
  }

  void check_corners() {
    for (std::size_t k = 0; k < corners_.count; ++k) {
      const std::uint32_t i = corners_.pair[k];
      if (HWY_UNLIKELY(outside<float>(polytope_of(*pairs_.hull[i]), at(corner_in_hull_, i), tolerance_[i]))) {
        doubtful_.add(i, true);
      }
    }
  }

  HWY_INLINE Vec3f vertex_in_box(std::size_t i, std::size_t v) const {
    return rotate(pairs_.placed.rotation_of(i), pairs_.hull[i]->vertex(v)) + pairs_.placed.offset_of(i);
  }
  HWY_INLINE bool outside_box(std::size_t i, Vec3f p) const {
    const float most = tolerance_[i];
    return std::abs(p.x) > pairs_.placed.first_size(0)[i] + most ||
           std::abs(p.y) > pairs_.placed.first_size(1)[i] + most ||
           std::abs(p.z) > pairs_.placed.first_size(2)[i] + most;
  }

  /// Searches the common point of an edge or a face of each. Returns it.
  HWY_NOINLINE Vec3f put_common_point(std::uint32_t i) {
    const Feature<float>& of_hull = feature_[i];
    const Vec3f corner = at(corner_, i), normal = at(out_.normal, i);
    const float depth = depth_[i], height = of_box_[i] - depth * 0.5f;
    FeaturePoints first, second;
    const std::uint32_t flats = flats_[i];
    for (std::uint32_t sides = 0; sides < 8; ++sides) {
      if ((sides & ~flats) != 0) continue;
      const auto side = [sides](float v, std::uint32_t bit) { return double{(sides & bit) != 0 ? -v : v}; };
      first.add({side(corner.x, 1), side(corner.y, 2), side(corner.z, 4)});
    }
    for_each_in(of_hull.vertices, pairs_.hull[i]->vertex_count(),
                [&](std::size_t v) HWY_ATTR { second.add(to_double(vertex_in_box(i, v))); });
    const Vec3f common = to_float(common_point(first.get(), second.get(), to_double(normal)));
    const Vec3f point = common + normal * (height - dot(normal, common));
    out_.put(i, std::max(depth, 0.0f), normal, point);
    return point;
  }

  void share_point(std::uint32_t i) {
    const Vec3f point = put_common_point(i);
    const Vec3f in_hull = rotate_inverse(pairs_.placed.rotation_of(i), point - pairs_.placed.offset_of(i));
    const bool is_outside =
        outside_box(i, point) || outside<float>(polytope_of(*pairs_.hull[i]), in_hull, tolerance_[i]);
    doubtful_.add(i, is_outside);
  }

  HWY_NOINLINE void test_alone(std::uint32_t i) {
    const BoxPolytope box(&pairs_.box(i).size[0]);
    const Polytope hull = polytope_of(*pairs_.hull[i]);
    const Placement<float> placed = pairs_.placed.get(i);
    const std::size_t of_box = farthest_vertex<float>(box.polytope(), placed.axis);
    const std::size_t of_hull = farthest_vertex<float>(hull, -placed.axis_in_second);
    const float value = (support<float>(box.polytope(), placed.axis) + support<float>(hull, -placed.axis_in_second)) -
                        pairs_.placed.along_axis(i);
    PolytopePair<float> pair(box.polytope(), hull, placed, {value, of_box, of_hull}, pairs_.work);
    Overlap<float> found;
    out_.hit[i] = 0;
    if (pair.test(found)) out_.put(i, found.depth, found.normal, found.point);
  }

  BoxHullPairs& pairs_;
  BlockContacts& out_;
  PairList corners_, others_, doubtful_;
  CrossingEdges<block_pairs> crossing_;
  alignas(64) Column3 in_hull_, corner_;  // the direction in the axes of the hull; the corner of the box that touches
  alignas(64) Column3 corner_in_hull_;    // that corner in the axes of the hull
  alignas(64) Column3 vertex_[2];         // the first and last vertex of the feature of the hull, in its own axes
  alignas(64) std::uint32_t part_[block_pairs];   // what touches of the hull; see Part
  alignas(64) std::uint32_t flats_[block_pairs];  // bit k: the corner and the one along axis k are equally far
  alignas(64) float slack_[block_pairs];          // the difference in height of the vertices of a feature
  alignas(64) float of_box_[block_pairs], along_[block_pairs];  // the height of the box; from origin to origin
  alignas(64) float depth_[block_pairs];
  alignas(64) float tolerance_[block_pairs];  // by how much a point may lie outside a shape
  Feature<float> feature_[block_pairs];
  alignas(64) float heights_[block_pairs][geometry::max_hull_vertices];  // of the vertices along the direction
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
