// Tests one pair of polytopes at a time, in float or double: pairs whose sizes differ too much for float, pairs that a
// block could not decide, and all pairs of hulls where there are no vectors. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_PAIR_KERNEL_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PAIR_KERNEL_INL
#undef RINGFENCE_NARROW_PHASE_PAIR_KERNEL_INL
#else
#define RINGFENCE_NARROW_PHASE_PAIR_KERNEL_INL
#endif

#include <cmath>
#include <cstddef>

#include "narrow_phase/hull/polytope_pair-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Provides support and polytope of a hull in the shape table.
class HullSource {
 public:
  static constexpr ShapeKind kind = ShapeKind::hull;
  HWY_INLINE HullSource(const geometry::ShapeView& shapes, const geometry::ShapeRow& row)
      : hull_(shapes.hull(row.index_in_kind)) {}
  /// The support along a direction; the vertex is determined on demand.
  template <class T>
  class Support {
   public:
    HWY_INLINE Support(const geometry::Hull& hull, Point<T> direction) : farthest_(farthest(hull, direction)) {}
    HWY_INLINE T value() const { return -farthest_.value(); }
    HWY_INLINE std::size_t vertex(const Polytope&) const { return farthest_.index(); }

   private:
    static HWY_INLINE Least<T> farthest(const geometry::Hull& hull, Point<T> direction) {
      const float* const columns[3] = {hull.x(), hull.y(), hull.z()};
      return farthest_of<T>(columns, hull.vertex_count(), direction);
    }
    Least<T> farthest_;
  };
  template <class T>
  HWY_INLINE Support<T> support(Point<T> direction) const {
    return {hull_, direction};
  }
  Vec3f centre() const { return hull_.centroid(); }
  std::size_t vertices() const { return hull_.vertex_count(); }
  Polytope polytope() const { return polytope_of(hull_); }

 private:
  const geometry::Hull& hull_;
};
class BoxSource {
 public:
  static constexpr ShapeKind kind = ShapeKind::box;
  HWY_INLINE BoxSource(const geometry::ShapeView&, const geometry::ShapeRow& row) : size_(row.size) {}
  template <class T>
  class Support {
   public:
    HWY_INLINE Support(const float* size, Point<T> direction) : size_(size), direction_(direction) {}
    HWY_INLINE T value() const {
      return (std::abs(direction_.x) * T(size_[0]) + std::abs(direction_.y) * T(size_[1])) +
             std::abs(direction_.z) * T(size_[2]);
    }
    HWY_INLINE std::size_t vertex(const Polytope& box) const { return farthest_vertex<T>(box, direction_); }

   private:
    const float* size_;
    Point<T> direction_;
  };
  template <class T>
  HWY_INLINE Support<T> support(Point<T> direction) const {
    return {size_, direction};
  }
  Vec3f centre() const { return {}; }
  std::size_t vertices() const { return 8; }
  BoxPolytope polytope() const { return BoxPolytope(size_); }

 private:
  const float* size_;
};
HWY_INLINE const Polytope& polytope_in(const Polytope& polytope) { return polytope; }
HWY_INLINE const Polytope& polytope_in(const BoxPolytope& box) { return box.polytope(); }

/// Converts an overlap from the axes of the first body to the pair's own a and b, and writes it. `first` is the
/// rotation of the first body, `world` the vector from the first body's position to the second's.
template <class T>
HWY_INLINE PairContact* write(const KernelPair& pair, const RotationMatrix<T>& first, Point<T> world,
                              const Overlap<T>& found, PairContact* out) {
  Point<T> normal = rotate(first, found.normal), point = rotate(first, found.point);
  if (pair.flipped != 0) {
    normal = -normal;
    point = point - world;
  }
  // Adding zero makes every zero positive, so that its sign does not depend on the computation.
  const auto plain = [](T value) { return static_cast<float>(value) + 0.0f; };
  *out = {pair.pair,
          plain(found.depth),
          {plain(normal.x), plain(normal.y), plain(normal.z)},
          {plain(point.x), plain(point.y), plain(point.z)}};
  return out + 1;
}

/// A cached axis has to separate two shapes by this part of their sizes: ten times the error of an overlap along a
/// direction.
inline constexpr float axis_margin = 1e-5f;

/// Whether a cached axis still separates the two shapes.
template <class First, class Second>
HWY_INLINE bool remembered_axis_separates(const First& first, const Second& second, const Placement<float>& placed,
                                          Vec3f axis, float size, WorkCounts& work) {
  const Vec3f n = rotate_inverse(placed.first, axis);
  const float value = (first.template support<float>(n).value() +
                       second.template support<float>(-rotate_inverse(placed.second_to_first, n)).value()) -
                      dot(n, placed.offset);
  ++work.directions;
  work.pass<float>(first.vertices());
  work.pass<float>(second.vertices());
  return value < -axis_margin * size;
}

/// Tests one pair, in float or double.
template <class T, class First, class Second, class Place>
HWY_INLINE PairContact* test_pair(const KernelInput& input, const KernelPair& pair, const First& first,
                                  const Second& second, Point<T> axis, Point<T> axis_in_second, T along_axis,
                                  const Place& placement, PairContact* out, WorkCounts& work) {
  const auto p_support = first.template support<T>(axis);
  const auto q_support = second.template support<T>(-axis_in_second);
  ++work.directions;
  work.pass<T>(first.vertices());
  work.pass<T>(second.vertices());
  const T value = (p_support.value() + q_support.value()) - along_axis;
  if (value < T(0)) return out;
  const Placement<T> placed = placement();
  const Body &a = input.bodies[pair.first], &b = input.bodies[pair.second];
  AxisMemory* const memory = sizeof(T) == 4 ? input.memory : nullptr;
  const AxisMemory::Key key = AxisMemory::key_of(a.number, b.number);
  if constexpr (sizeof(T) == 4) {
    if (memory != nullptr && (*memory)[key].tag == key.tag) {
      const float size = input.shapes.row(a.shape).bounding_radius + input.shapes.row(b.shape).bounding_radius;
      if (remembered_axis_separates(first, second, placed, (*memory)[key].axis, size, work)) {
        ++work.ended_early;
        return out;
      }
      (*memory)[key].tag = 0;
    }
  }
  const auto p = first.polytope();
  const auto q = second.polytope();
  PolytopePair<T> overlap(polytope_in(p), polytope_in(q), placed,
                          {value, p_support.vertex(polytope_in(p)), q_support.vertex(polytope_in(q))}, work);
  Overlap<T> found;
  if (overlap.test(found)) return write(pair, placed.first, placed.world, found, out);
  if constexpr (sizeof(T) == 4) {
    if (memory != nullptr) (*memory)[key] = {key.tag, rotate(placed.first, overlap.direction())};
  }
  return out;
}

template <class First, class Second>
PairContact* run_in_float(const KernelInput& input, PairContact* out, KindCounters& counters) {
  PlacementColumns placed;
  WorkCounts work;
  for (std::size_t begin = 0; begin < input.pairs.size();) {
    const std::span<const KernelPair> rest = input.pairs.subspan(begin);
    begin_gathering(input);
    const std::size_t count = placed.fill<First::kind, Second::kind>(input, rest.data(), rest.size());
    end_gathering(input);
    for (std::size_t i = 0; i < count; ++i) {
      const First first(input.shapes, input.shapes.row(input.bodies[rest[i].first].shape));
      const Second second(input.shapes, input.shapes.row(input.bodies[rest[i].second].shape));
      out = test_pair<float>(
          input, rest[i], first, second, placed.axis(i), placed.axis_in_second(i), placed.along_axis(i),
          [&]() HWY_ATTR { return placed.get(i); }, out, work);
    }
    begin += count;
  }
  work.add_to(counters);
  return out;
}

template <class First, class Second>
PairContact* run_in_double(const KernelInput& input, PairContact* out, KindCounters& counters) {
  WorkCounts work;
  for (const KernelPair& pair : input.pairs) {
    begin_gathering(input);
    const Body& p = input.bodies[pair.first];
    const Body& q = input.bodies[pair.second];
    const First first(input.shapes, input.shapes.row(p.shape));
    const Second second(input.shapes, input.shapes.row(q.shape));
    const Placement<double> placed = placement_of(p.pose, first.centre(), q.pose, second.centre());
    end_gathering(input);
    out = test_pair<double>(
        input, pair, first, second, placed.axis, placed.axis_in_second, dot(placed.axis, placed.offset),
        [&]() HWY_ATTR { return placed; }, out, work);
  }
  work.add_to(counters);
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
