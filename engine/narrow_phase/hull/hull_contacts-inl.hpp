// Depth and point along the best direction of two hulls, for a block of pairs. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_HULL_CONTACTS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_HULL_CONTACTS_INL
#undef RINGFENCE_NARROW_PHASE_HULL_CONTACTS_INL
#else
#define RINGFENCE_NARROW_PHASE_HULL_CONTACTS_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/hull_pairs-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Computes the contacts of the undecided pairs of a block along their best directions, as PolytopePair::measured does.
/// The pairs are sorted by the features that touch: a vertex of either hull, or two edges that cross. All others, and
/// pairs whose point lies outside a hull, are measured by PolytopePair.
class HullContacts {
 public:
  HullContacts(HullPairs& pairs, BlockContacts& out) : pairs_(pairs), out_(out) {}

  /// `left_over`: one bit for each pair that the steps before could not decide; these are tested one at a time.
  void run(std::uint32_t left_over) {
    compute_normals();
    find_features(left_over);
    for (std::size_t k = 0; k < list_[vertex_of_second].count; ++k)
      touch_vertex_of_second(list_[vertex_of_second].pair[k]);
    for (std::size_t k = 0; k < list_[vertex_of_first].count; ++k)
      touch_vertex_of_first(list_[vertex_of_first].pair[k]);
    for (std::size_t k = 0; k < list_[two_edges].count; ++k) cross_edges(list_[two_edges].pair[k]);
    for (std::size_t k = 0; k < list_[others].count; ++k) measure_alone(list_[others].pair[k]);
    for (std::size_t k = 0; k < list_[doubtful].count; ++k) test_alone(list_[doubtful].pair[k]);
  }

 private:
  using D = HullPairs::D;
  using V = HullPairs::V;
  using Column3 = HullPairs::Column3;
  static constexpr D d{};
  static constexpr std::size_t lanes = HullPairs::lanes;

  /// What touches. `doubtful`: the pair is tested again, alone.
  enum Touching : std::size_t { vertex_of_second, vertex_of_first, two_edges, others, doubtful, touchings };

  HWY_INLINE const geometry::Hull& hull(std::size_t side, std::size_t i) const { return *pairs_.hull[side][i]; }

  void compute_normals() {
    for (std::size_t i = 0; i < pairs_.count; i += lanes) {
      Vector<D> n = load(d, pairs_.best_direction, i);
      n = scale(d, n, hn::Set(d, 1.0f) / hn::Sqrt(dot(d, n, n)));
      store(d, n, normal_, i);
      store(d, negate(d, unrotate(d, pairs_.placed.rotation_lanes(d, i), n)), in_second_, i);
      hn::Store(dot(d, n, pairs_.placed.offset_lanes(d, i)), d, along_ + i);
      hn::Store(hn::Set(d, Rounding<float>::height) * hn::Load(d, pairs_.size + i), d, slack_ + i);
    }
  }

  void find_features(std::uint32_t left_over) {
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::uint32_t i = pairs_.undecided.pair[u];
      Feature<float>&of_a = feature_[0][i], &of_b = feature_[1][i];
      find_feature<float>(polytope_of(hull(0, i)), at(normal_, i), slack_[i], of_a);
      find_feature<float>(polytope_of(hull(1, i)), at(in_second_, i), slack_[i], of_b);
      const float depth = (of_a.height + of_b.height) - along_[i];
      depth_[i] = depth;
      // Without branches, which would be unpredictable.
      Touching touching = of_a.count == 2 && of_b.count == 2 ? two_edges : others;
      touching = of_a.count == 1 ? vertex_of_first : touching;
      touching = of_b.count == 1 ? vertex_of_second : touching;
      const bool deeper = depth > pairs_.best[i] + Rounding<float>::sure * (pairs_.best[i] + pairs_.size[i]);
      touching = deeper || (left_over >> i & 1) != 0 ? doubtful : touching;
      list_[touching].pair[list_[touching].count++] = i;
    }
  }

  HWY_INLINE Vec3f vertex_of_a(std::size_t i, std::size_t v) const { return hull(0, i).vertex(v); }
  HWY_INLINE Vec3f vertex_of_b(std::size_t i, std::size_t v) const {
    return rotate(pairs_.placed.rotation_of(i), hull(1, i).vertex(v)) + pairs_.placed.offset_of(i);
  }
  HWY_INLINE float outside_tolerance(std::size_t i) const {
    return 2e-5f * std::min(hull(0, i).bounding_radius(), hull(1, i).bounding_radius());
  }
  HWY_INLINE void put(std::size_t i, Vec3f point) {
    out_.put(i, depth_[i] > 0 ? depth_[i] : 0.0f, at(normal_, i), point);
  }

  void touch_vertex_of_second(std::size_t i) {
    const Vec3f vertex = vertex_of_b(i, feature_[1][i].first());
    if (HWY_UNLIKELY(outside(polytope_of(hull(0, i)), vertex, outside_tolerance(i)))) return measure_alone(i);
    put(i, vertex + at(normal_, i) * (depth_[i] * 0.5f));
  }
  void touch_vertex_of_first(std::size_t i) {
    const Vec3f vertex = vertex_of_a(i, feature_[0][i].first());
    const Vec3f in_second = rotate_inverse(pairs_.placed.rotation_of(i), vertex - pairs_.placed.offset_of(i));
    if (HWY_UNLIKELY(outside(polytope_of(hull(1, i)), in_second, outside_tolerance(i)))) return measure_alone(i);
    put(i, vertex - at(normal_, i) * (depth_[i] * 0.5f));
  }

  void cross_edges(std::size_t i) {
    const std::size_t a[2] = {feature_[0][i].first(), feature_[0][i].last(hull(0, i).vertex_count())};
    const std::size_t b[2] = {feature_[1][i].first(), feature_[1][i].last(hull(1, i).vertex_count())};
    const Vec3f p = vertex_of_a(i, a[1]) - vertex_of_a(i, a[0]);
    const Vec3f q = rotate(pairs_.placed.rotation_of(i), hull(1, i).vertex(b[1]) - hull(1, i).vertex(b[0]));
    const Vec3f across = cross(p, q);
    // Nearly parallel edges: their common point has to be searched.
    if (HWY_UNLIKELY(dot(across, across) < 1e-4f * dot(p, p) * dot(q, q))) return measure_alone(i);
    const Vec3d first[2] = {to_double(vertex_of_a(i, a[0])), to_double(vertex_of_a(i, a[1]))};
    const Vec3d second[2] = {to_double(vertex_of_b(i, b[0])), to_double(vertex_of_b(i, b[1]))};
    const Vec3f normal = at(normal_, i);
    const Vec3f common = to_float(common_point(first, second, to_double(normal)));
    const float height = feature_[0][i].height - depth_[i] * 0.5f;
    put(i, common + normal * (height - dot(normal, common)));
  }

  HWY_NOINLINE void measure_alone(std::size_t i) {
    const Polytope a = polytope_of(hull(0, i)), b = polytope_of(hull(1, i));
    const Placement<float> placed = pairs_.placed.get(i);
    PolytopePair<float> pair(a, b, placed, {pairs_.axis_overlap[i], 0, 0}, pairs_.work);
    const Overlap<float> found = pair.measured_along(at(pairs_.best_direction, i));
    out_.put(i, found.depth, found.normal, found.point);
  }

  HWY_NOINLINE void test_alone(std::size_t i) {
    const Polytope a = polytope_of(hull(0, i)), b = polytope_of(hull(1, i));
    const Placement<float> placed = pairs_.placed.get(i);
    const std::size_t of_a = farthest_vertex<float>(a, placed.axis);
    const std::size_t of_b = farthest_vertex<float>(b, -placed.axis_in_second);
    PolytopePair<float> pair(a, b, placed, {pairs_.axis_overlap[i], of_a, of_b}, pairs_.work);
    Overlap<float> found;
    if (pair.test(found)) {
      out_.put(i, found.depth, found.normal, found.point);
    } else if (pairs_.input.memory != nullptr) {
      pairs_.remember(i, pair.direction());
    }
  }

  struct List {
    std::size_t count = 0;
    std::uint32_t pair[block_pairs];
  };

  HullPairs& pairs_;
  BlockContacts& out_;
  List list_[touchings];
  alignas(64) Column3 normal_, in_second_;  // the best directions, unit, in the axes of either side
  alignas(64) float along_[block_pairs];    // from origin to origin along the normal
  alignas(64) float slack_[block_pairs];    // the difference in height of the vertices of a feature
  alignas(64) float depth_[block_pairs];
  Feature<float> feature_[2][block_pairs];
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
