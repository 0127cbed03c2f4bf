// Depth and point along the best direction of two hulls, for a block of pairs. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_HULL_CONTACTS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_HULL_CONTACTS_INL
#undef RINGFENCE_NARROW_PHASE_HULL_CONTACTS_INL
#else
#define RINGFENCE_NARROW_PHASE_HULL_CONTACTS_INL
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/crossing_edges-inl.hpp"
#include "narrow_phase/hull/hull_pairs-inl.hpp"
#include "narrow_phase/hull/polytope_contact-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Computes the contacts of the undecided pairs of a block along their best directions, as PolytopeContact does.
/// The pairs are sorted by the features that touch: a vertex of either hull, or two edges that cross. All others, and
/// pairs whose point lies outside a hull, are measured by PolytopeContact.
class HullContacts {
 public:
  HullContacts(HullPairs& pairs, BlockContacts& out) : pairs_(pairs), out_(out) {}

  /// `left_over`: one bit for each pair that the steps before could not decide; these are tested one at a time.
  void run(std::uint32_t left_over) {
    // The lanes of decided pairs are computed too: leftovers on the stack could be slow to compute with.
    set_zero(depth_);
    compute_normals();
    find_features(left_over);
    for (std::size_t k = 0; k < list_[vertex_of_second].count; ++k)
      touch_vertex_of_second(list_[vertex_of_second].pair[k]);
    for (std::size_t k = 0; k < list_[vertex_of_first].count; ++k)
      touch_vertex_of_first(list_[vertex_of_first].pair[k]);
    if (list_[two_edges].count > 0) cross_edges();
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

  /// Computes the points where two edges cross.
  void cross_edges() {
    set_zero(end_);
    set_zero(height_);
    std::uint32_t crossing = 0;
    for (std::size_t k = 0; k < list_[two_edges].count; ++k) {
      const std::size_t i = list_[two_edges].pair[k];
      for (std::size_t side = 0; side < 2; ++side) {
        const Feature<float>& edge = feature_[side][i];
        narrow_phase::HWY_NAMESPACE::put(hull(side, i).vertex(edge.first()), end_[2 * side], i);
        narrow_phase::HWY_NAMESPACE::put(hull(side, i).vertex(edge.last(hull(side, i).vertex_count())),
                                         end_[2 * side + 1], i);
      }
      height_[i] = feature_[0][i].height;
      crossing |= 1u << i;
    }
    for (std::size_t i = 0; i < pairs_.count; i += lanes) collect_crossing(i, crossing >> i);
    crossing_.compute();
    for (std::size_t k = 0; k < crossing_.count; ++k) {
      const std::size_t i = crossing_.pair[k];
      crossing &= ~(1u << i);
      if (HWY_LIKELY(crossing_.found(k))) {
        put(i, crossing_.at(k));
      } else {
        measure_alone(i);
      }
    }
    // Nearly parallel edges: their common point has to be searched.
    for (; HWY_UNLIKELY(crossing != 0); crossing &= crossing - 1) {
      measure_alone(static_cast<std::size_t>(std::countr_zero(crossing)));
    }
  }

  /// Collects those of the pairs from `i` on, one bit each, whose edges are not nearly parallel.
  HWY_INLINE void collect_crossing(std::size_t i, std::uint32_t crossing) {
    const Rotation<D> r = pairs_.placed.rotation_lanes(d, i);
    const Vector<D> offset = pairs_.placed.offset_lanes(d, i);
    const Vector<D> first_a = load(d, end_[0], i), last_a = load(d, end_[1], i), first_b = load(d, end_[2], i),
                    last_b = load(d, end_[3], i);
    const Vector<D> p = subtract(d, last_a, first_a), q = rotate(d, r, subtract(d, last_b, first_b));
    const Vector<D> across = cross(d, p, q);
    const auto apart = hn::Ge(dot(d, across, across), hn::Set(d, 1e-4f) * dot(d, p, p) * dot(d, q, q));
    const std::uint8_t bits[8] = {static_cast<std::uint8_t>(crossing), static_cast<std::uint8_t>(crossing >> 8)};
    crossing_.add(d, hn::And(apart, hn::LoadMaskBits(d, bits)), i, load(d, normal_, i),
                  hn::Load(d, height_ + i) - hn::Load(d, depth_ + i) * hn::Set(d, 0.5f), first_a, last_a,
                  add(d, rotate(d, r, first_b), offset), add(d, rotate(d, r, last_b), offset));
  }

  HWY_NOINLINE void measure_alone(std::size_t i) {
    const Polytope a = polytope_of(hull(0, i)), b = polytope_of(hull(1, i));
    const RotationMatrix<float> rotation = pairs_.placed.rotation_of(i);
    const Vec3f offset = pairs_.placed.offset_of(i);
    const Overlap<float> found = PolytopeContact<float>(a, b, rotation, offset).along(at(pairs_.best_direction, i));
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
  alignas(64) float height_[block_pairs];  // of the edge of the first hull
  alignas(64) Column3 end_[4];             // the ends of the edges that cross, in their own axes
  Feature<float> feature_[2][block_pairs];
  CrossingEdges<block_pairs> crossing_;
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
