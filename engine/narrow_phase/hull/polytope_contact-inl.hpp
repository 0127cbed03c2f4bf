// Depth and point of the contact of two convex polytopes along a known direction. Included once for each Highway
// target.

#if defined(RINGFENCE_NARROW_PHASE_POLYTOPE_CONTACT_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_POLYTOPE_CONTACT_INL
#undef RINGFENCE_NARROW_PHASE_POLYTOPE_CONTACT_INL
#else
#define RINGFENCE_NARROW_PHASE_POLYTOPE_CONTACT_INL
#endif

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "narrow_phase/hull/placement-inl.hpp"
#include "narrow_phase/hull/support_feature-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Computes the contact of two polytopes along the direction of least overlap, one pair at a time. All in the axes of
/// the first one, a, and relative to its origin.
template <class T>
class PolytopeContact {
 public:
  /// The arguments outlive this object.
  HWY_INLINE PolytopeContact(const Polytope& a, const Polytope& b, const RotationMatrix<T>& second_to_first,
                             const Point<T>& offset)
      : a_(a), b_(b), rotation_(second_to_first), offset_(offset) {}

  /// Depth and point along a direction from a to b, of any length.
  Overlap<T> along(Point<T> direction) const {
    const T inverse = T(1) / std::sqrt(dot(direction, direction));
    const Point<T> normal = direction * inverse;
    const T slack = Rounding<T>::height * size();
    Feature<T> of_a, of_b;
    find_feature<T>(a_, normal, slack, of_a);
    find_feature<T>(b_, -rotate_inverse(rotation_, normal), slack, of_b);
    const T depth = (of_a.height + of_b.height) - dot(normal, offset_);
    Overlap<T> result{depth > T(0) ? depth : T(0), normal, {}};
    const T height = of_a.height - depth * T(0.5);
    if (of_b.count == 1) {
      const Point<T> vertex = vertex_of_b(of_b.first());
      result.point = vertex + normal * (depth * T(0.5));
      if (outside(a_, vertex, outside_tolerance()))
        result.point = search_contact_point(normal, height, depth, result.point);
    } else if (of_a.count == 1) {
      const Point<T> vertex = vertex_of_a(of_a.first());
      result.point = vertex - normal * (depth * T(0.5));
      if (outside(b_, rotate_inverse(rotation_, vertex - offset_), outside_tolerance()))
        result.point = search_contact_point(normal, height, depth, result.point);
    } else {
      result.point = shared_point(of_a, of_b, normal, height);
      // Two crossing edges meet inside both shapes, except for very different sizes, which are tested in double.
      const bool cross = sizeof(T) == 4 && of_a.count == 2 && of_b.count == 2 && !nearly_parallel(of_a, of_b);
      if (!cross && distance_outside(result.point) > outside_tolerance()) {
        result.point = search_contact_point(normal, height, depth, result.point);
      }
    }
    return result;
  }

 private:
  HWY_INLINE T size() const { return T(a_.outer_radius) + T(b_.outer_radius); }

  HWY_INLINE Point<T> vertex_of_a(std::size_t i) const { return vertex_of<T>(a_, i); }
  HWY_INLINE Point<T> vertex_of_b(std::size_t i) const { return rotate(rotation_, vertex_of<T>(b_, i)) + offset_; }

  /// The largest distance by which a contact point may lie outside of either shape.
  HWY_INLINE T outside_tolerance() const { return T(2e-5) * T(std::min(a_.outer_radius, b_.outer_radius)); }

  /// Whether two edges, each of two vertices, are parallel within 0.01.
  bool nearly_parallel(const Feature<T>& of_a, const Feature<T>& of_b) const {
    const Point<T> p = vertex_of_a(of_a.last(a_.vertices)) - vertex_of_a(of_a.first());
    const Point<T> q = rotate(rotation_, vertex_of<T>(b_, of_b.last(b_.vertices)) - vertex_of<T>(b_, of_b.first()));
    const Point<T> across = cross(p, q);
    return dot(across, across) < T(1e-4) * dot(p, p) * dot(q, q);
  }

  /// The distance by which one point lies outside of a, or another one outside of b: the greater one.
  HWY_INLINE T distance_outside(Point<T> of_a, Point<T> of_b) const {
    return std::max(distance_outside_polytope<T>(a_, of_a),
                    distance_outside_polytope<T>(b_, rotate_inverse(rotation_, of_b - offset_)));
  }
  HWY_INLINE T distance_outside(Point<T> point) const { return distance_outside(point, point); }

  struct FoundPoint {
    Point<T> point;
    T outside;
  };

  /// Searches the contact point where the deepest feature of one shape lies beside the other shape. There two faces or
  /// edges are so nearly parallel that a larger part of them, which is only slightly less deep, makes the contact. The
  /// tolerance for this part is increased until a point is found of which `outside(point)` is small.
  template <class Outside>
  FoundPoint search_common_point(Point<T> normal, T height, Point<T> first, const Outside& outside) const {
    FoundPoint best{first, outside(first)};
    for (T factor = 32; factor < T(1e5) && best.outside > outside_tolerance(); factor *= 32) {
      const T slack = factor * Rounding<T>::height * size();
      Feature<T> of_a, of_b;
      find_feature<T>(a_, normal, slack, of_a);
      find_feature<T>(b_, -rotate_inverse(rotation_, normal), slack, of_b);
      const Point<T> point = shared_point(of_a, of_b, normal, height);
      const T out = outside(point);
      best = out < best.outside ? FoundPoint{point, out} : best;
    }
    return best;
  }

  /// The contact point lies in both shapes, unless one reaches out of the other side of a thin one. Then it is midway
  /// between the places that would touch if the shapes were moved apart.
  HWY_NOINLINE Point<T> search_contact_point(Point<T> normal, T height, T depth, Point<T> first) const {
    const FoundPoint common =
        search_common_point(normal, height, first, [&](Point<T> p) HWY_ATTR { return distance_outside(p); });
    if (common.outside <= outside_tolerance()) return common.point;
    const Point<T> half = normal * (depth * T(0.5));
    return search_common_point(normal, height, common.point,
                               [&](Point<T> p) HWY_ATTR { return distance_outside(p + half, p - half); })
        .point;
  }

  HWY_NOINLINE Point<T> shared_point(const Feature<T>& of_a, const Feature<T>& of_b, Point<T> normal, T height) const {
    FeaturePoints first, second;
    const auto in_double = [](Point<T> p) { return Vec3d{double(p.x), double(p.y), double(p.z)}; };
    for_each_in(of_a.vertices, a_.vertices, [&](std::size_t i) HWY_ATTR { first.add(in_double(vertex_of_a(i))); });
    for_each_in(of_b.vertices, b_.vertices, [&](std::size_t i) HWY_ATTR { second.add(in_double(vertex_of_b(i))); });
    const Vec3d p = common_point(first.get(), second.get(), in_double(normal));
    const Point<T> common{static_cast<T>(p.x), static_cast<T>(p.y), static_cast<T>(p.z)};
    return common + normal * (height - dot(normal, common));
  }

  const Polytope& a_;
  const Polytope& b_;
  const RotationMatrix<T>& rotation_;
  const Point<T>& offset_;
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
