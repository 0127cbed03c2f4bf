// A convex hull against the triangles of a mesh: the exact penetration of one triangle, with the features of the hull
// in lanes of double. Included once for each Highway target.
//
// The faces of the Minkowski difference of a hull and a triangle are those of the hull, the two sides of the triangle,
// and one for each pair of edges whose arcs of normals cross. The normals of a triangle's edge form half a great circle
// about the edge. So it crosses the arcs of those edges of the hull that separate the faces that point along the
// triangle's edge from those that point against it: the silhouette of the hull along the edge.

#if defined(RINGFENCE_NARROW_PHASE_MESH_HULL_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_MESH_HULL_INL
#undef RINGFENCE_NARROW_PHASE_MESH_HULL_INL
#else
#define RINGFENCE_NARROW_PHASE_MESH_HULL_INL
#endif

#include <algorithm>
#include <limits>

#include "geometry/hull.hpp"
#include "narrow_phase/hull/support_feature-inl.hpp"
#include "narrow_phase/mesh/mesh_convex-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The planes of the faces of a hull in the axes of a mesh, relative to the origin of the hull. In float, for bounds.
/// They are computed by the first call of prepare(): most hulls near a large mesh need none.
class FacesInMesh {
 public:
  HWY_INLINE void prepare(const geometry::Hull& hull, const geometry::RotationD& rotation) {
    if (count_ == 0) compute(hull, rotation);
  }

  /// The least overlap along the normals, of boxes and of triangles relative to the origin of the hull, where it is not
  /// below `floor`; elsewhere a number below it. At most `bound`.
  template <class D>
  HWY_INLINE hn::Vec<D> boxes(D d, const Vector<D>& centre, const Vector<D>& half, hn::Vec<D> bound,
                              float floor) const {
    return least_overlap(d, bound, floor,
                         [&](const Vector<D>& n) HWY_ATTR { return dot(d, n, centre) - reach_along(d, n, half); });
  }
  template <class D>
  HWY_INLINE hn::Vec<D> triangles(D d, const Vector<D> (&corner)[3], hn::Vec<D> bound, float floor) const {
    return least_overlap(d, bound, floor, [&](const Vector<D>& n) HWY_ATTR {
      return hn::Min(dot(d, n, corner[0]), hn::Min(dot(d, n, corner[1]), dot(d, n, corner[2])));
    });
  }

 private:
  using Doubles = hn::CappedTag<double, 8>;
  using Floats = hn::Rebind<float, Doubles>;
  static constexpr std::size_t max_faces = 2 * geometry::max_hull_vertices;
  static constexpr std::size_t faces_at_once = 4;
  static_assert(geometry::hull_lanes % faces_at_once == 0);

  HWY_NOINLINE void compute(const geometry::Hull& hull, const geometry::RotationD& rotation) {
    const Doubles d;
    const Floats f;
    offset_ = hull.offset();
    count_ = (hull.face_count() + faces_at_once - 1) / faces_at_once * faces_at_once;
    for (std::size_t i = 0; i < count_; i += hn::Lanes(d)) {
      const auto x = hn::PromoteTo(d, hn::Load(f, hull.normal_x() + i));
      const auto y = hn::PromoteTo(d, hn::Load(f, hull.normal_y() + i));
      const auto z = hn::PromoteTo(d, hn::Load(f, hull.normal_z() + i));
      for (int k = 0; k < 3; ++k) {
        const auto* const m = rotation.m[k];
        hn::Store(hn::DemoteTo(f, hn::Set(d, m[0]) * x + hn::Set(d, m[1]) * y + hn::Set(d, m[2]) * z), f,
                  normal_[k] + i);
      }
    }
  }

  template <class D, class Lowest>
  HWY_INLINE hn::Vec<D> least_overlap(D d, hn::Vec<D> bound, float floor, const Lowest& lowest) const {
    const auto least = hn::Set(d, floor);
    for (std::size_t i = 0; i < count_ && !hn::AllTrue(d, bound < least); i += faces_at_once) {
      for (std::size_t k = i; k < i + faces_at_once; ++k) {
        const Vector<D> n{hn::Set(d, normal_[0][k]), hn::Set(d, normal_[1][k]), hn::Set(d, normal_[2][k])};
        bound = hn::Min(bound, hn::Set(d, offset_[k]) - lowest(n));
      }
    }
    return bound;
  }

  const float* offset_ = nullptr;
  std::size_t count_ = 0;  ///< rounded up to faces_at_once: the columns are padded by copies of the first face
  alignas(64) float normal_[3][max_faces];
};

struct HullInMesh {
  static constexpr std::size_t max_corners = geometry::max_hull_vertices;
  const geometry::Hull& hull;
  Vec3d origin;
  geometry::RotationD rotation;
  BoxInMesh bounding_box;
  mutable FacesInMesh planes;  ///< computed when they are needed

  HullInMesh(const geometry::Hull& own_hull, Vec3d own_origin, const geometry::RotationD& own_rotation)
      : hull(own_hull), origin(own_origin), rotation(own_rotation) {
    const FloatLanes f;
    const float* const column[3] = {hull.x(), hull.y(), hull.z()};
    double middle[3];
    for (int k = 0; k < 3; ++k) {
      auto low = hn::Load(f, column[k]), high = low;
      for (std::size_t i = hn::Lanes(f); i < hull.vertex_count(); i += hn::Lanes(f)) {
        low = hn::Min(low, hn::Load(f, column[k] + i));
        high = hn::Max(high, hn::Load(f, column[k] + i));
      }
      const double from{hn::GetLane(hn::MinOfLanes(f, low))}, to{hn::GetLane(hn::MaxOfLanes(f, high))};
      middle[k] = 0.5 * (from + to);
      bounding_box.half[k] = 0.5 * (to - from);
    }
    bounding_box.centre = origin + geometry::rotate(rotation, Vec3d{middle[0], middle[1], middle[2]});
    bounding_box.rotation = rotation;
  }

  static HullInMesh of(const geometry::ShapeView& shapes, const geometry::ShapeRow& row, const MeshFrame& frame) {
    return {shapes.hull(row.index_in_kind), frame.position, frame.rotation};
  }

  template <class D>
  HWY_INLINE hn::Vec<D> boxes(D d, const BoxLanes<D>& in, float floor) const {
    const auto bound = bounding_box.boxes(d, in, floor);
    // The faces rarely exclude a box that is larger than the hull and that the box of the hull does not exclude.
    const auto largest = hn::Max(in.half.x, hn::Max(in.half.y, in.half.z));
    const auto is_larger = hn::Gt(largest, at(d, bounding_box.largest_half()));
    const auto decided = hn::Or(hn::Lt(bound, hn::Set(d, floor)), is_larger);
    if (hn::AllTrue(d, decided)) return bound;
    planes.prepare(hull, rotation);
    // Only where undecided, so that the bounds do not depend on which boxes are in one vector.
    const auto by_faces = planes.boxes(d, subtract(d, in.centre, spread_out(d, origin)), in.half, bound, floor);
    return hn::IfThenElse(decided, bound, by_faces);
  }
  template <class D>
  HWY_INLINE hn::Vec<D> triangles(D d, const TriangleLanes<D>& in, float floor) const {
    const auto bound = bounding_box.triangles(d, in, floor);
    if (hn::AllTrue(d, bound < hn::Set(d, floor))) return bound;
    planes.prepare(hull, rotation);
    const Vector<D> own = spread_out(d, origin);
    const Vector<D> corner[3] = {subtract(d, in.corner[0], own), subtract(d, in.corner[1], own),
                                 subtract(d, in.corner[2], own)};
    return planes.triangles(d, corner, bound, floor);
  }

  Penetration penetration(const Triangle& triangle, double at_least) const {
    Vec3d corner[3];
    for (int i = 0; i < 3; ++i) corner[i] = geometry::rotate_inverse(rotation, triangle.corner[i] - origin);
    Best best;
    if (!sides(corner, at_least, best) || !faces(corner, at_least, best) || !edges(corner, at_least, best)) return {};
    // Up to here the normal points from the hull to the triangle.
    return {best.depth, geometry::rotate(rotation, -best.normal)};
  }

  std::size_t corners(const Penetration&, Vec3d* out) const {
    for (std::size_t i = 0; i < hull.vertex_count(); ++i) {
      out[i] = origin + geometry::rotate(rotation, to_double(hull.vertex(i)));
    }
    return hull.vertex_count();
  }
  double rounding() const { return 0; }

 private:
  using Doubles = hn::CappedTag<double, 8>;
  using Floats = hn::Rebind<float, Doubles>;

  struct Best {
    double depth = std::numeric_limits<double>::infinity();
    Vec3d normal;  ///< in the axes of the hull, from the hull to the triangle

    bool take(double value, Vec3d unit, double at_least) {
      if (value < depth) depth = value, normal = unit;
      return depth >= at_least;
    }
  };

  static double lowest_of(Vec3d p, Vec3d q, Vec3d r, Vec3d unit) {
    return std::min(ringfence::dot(unit, p), std::min(ringfence::dot(unit, q), ringfence::dot(unit, r)));
  }

  static HWY_INLINE hn::Vec<Doubles> read(const float* column) {
    const Floats f;
    return hn::PromoteTo(Doubles(), hn::Load(f, column));
  }
  static HWY_INLINE Vector<Doubles> spread(Vec3d p) {
    return {hn::Set(Doubles(), p.x), hn::Set(Doubles(), p.y), hn::Set(Doubles(), p.z)};
  }

  /// Tries the two sides of the triangle.
  bool sides(const Vec3d corner[3], double at_least, Best& best) const {
    const Vec3d across = ringfence::cross(corner[1] - corner[0], corner[2] - corner[0]);
    const Vec3d normal = across * (1 / length(across));
    const double at_plane = ringfence::dot(normal, corner[0]);
    const Extent extent = extent_along(normal);
    return best.take(extent.high - at_plane, normal, at_least) && best.take(at_plane - extent.low, -normal, at_least);
  }

  struct Extent {
    double low, high;
  };
  /// The extent of the hull along a unit vector in its axes.
  Extent extent_along(Vec3d unit) const {
    const Doubles d;
    const Vector<Doubles> n = spread(unit);
    auto low = hn::Set(d, std::numeric_limits<double>::infinity()), high = hn::Neg(low);
    for (std::size_t i = 0; i < hull.vertex_count(); i += hn::Lanes(d)) {
      const auto height = dot(d, n, Vector<Doubles>{read(hull.x() + i), read(hull.y() + i), read(hull.z() + i)});
      low = hn::Min(low, height);
      high = hn::Max(high, height);
    }
    return {hn::GetLane(hn::MinOfLanes(d, low)), hn::GetLane(hn::MaxOfLanes(d, high))};
  }

  bool faces(const Vec3d corner[3], double at_least, Best& best) const {
    const Doubles d;
    const Vector<Doubles> p = spread(corner[0]), q = spread(corner[1]), r = spread(corner[2]);
    alignas(64) double depth[8];
    for (std::size_t i = 0; i < hull.face_count(); i += hn::Lanes(d)) {
      const Vector<Doubles> n{read(hull.normal_x() + i), read(hull.normal_y() + i), read(hull.normal_z() + i)};
      const auto lowest = hn::Min(dot(d, n, p), hn::Min(dot(d, n, q), dot(d, n, r)));
      const auto value = read(hull.offset() + i) - lowest;
      if (hn::AllFalse(d, value < hn::Set(d, best.depth))) continue;
      hn::Store(value, d, depth);
      for (std::size_t lane = 0; lane < hn::Lanes(d) && i + lane < hull.face_count(); ++lane) {
        if (!best.take(depth[lane], to_double(hull.normal(i + lane)), at_least)) return false;
      }
    }
    return true;
  }

  bool edges(const Vec3d corner[3], double at_least, Best& best) const {
    for (int k = 0; k < 3; ++k) {
      if (!edges_across(corner[k], corner[next_of(k)] - corner[k], corner[next_of(next_of(k))], at_least, best)) {
        return false;
      }
    }
    return true;
  }

  /// Tries the hull's edges whose arcs cross that of the triangle's edge, which starts at `from` with direction `edge`.
  bool edges_across(Vec3d from, Vec3d edge, Vec3d opposite, double at_least, Best& best) const {
    const Doubles d;
    using geometry::EdgeColumn;
    const double edge_length = length(edge);
    const Vector<Doubles> e = spread(edge * (1 / edge_length)), p = spread(from), q = spread(opposite);
    const auto vector = [&](EdgeColumn x, EdgeColumn y, EdgeColumn z, std::size_t i) {
      return Vector<Doubles>{read(hull.edge_column(x) + i), read(hull.edge_column(y) + i),
                             read(hull.edge_column(z) + i)};
    };
    // Face normals are rounded to float: arcs that nearly cross are tried too. Their overlap is too small by a
    // negligible amount.
    const auto miss = hn::Set(d, 3e-7);
    alignas(64) double overlap_of[8], squared_of[8], axis_of[3][8];
    for (std::size_t i = 0; i < hull.edge_count(); i += hn::Lanes(d)) {
      const Vector<Doubles> left = vector(EdgeColumn::left_x, EdgeColumn::left_y, EdgeColumn::left_z, i);
      const Vector<Doubles> right = vector(EdgeColumn::right_x, EdgeColumn::right_y, EdgeColumn::right_z, i);
      const auto to_left = dot(d, e, left), to_right = dot(d, e, right);
      auto chance = hn::And(hn::Min(to_left, to_right) < miss, hn::Max(to_left, to_right) > hn::Neg(miss));
      if (hn::AllFalse(d, chance)) continue;
      const Vector<Doubles> along = vector(EdgeColumn::along_x, EdgeColumn::along_y, EdgeColumn::along_z, i);
      const Vector<Doubles> start = vector(EdgeColumn::from_x, EdgeColumn::from_y, EdgeColumn::from_z, i);
      Vector<Doubles> axis = cross(d, e, along);
      const auto inwards = dot(d, axis, add(d, left, right)) < hn::Zero(d);
      axis = choose(d, inwards, negate(d, axis), axis);
      const auto squared = dot(d, axis, axis);
      const auto lowest = hn::Min(dot(d, axis, p), dot(d, axis, q));
      const auto overlap = dot(d, axis, start) - lowest;
      // Edge directions are floats too: edges nearer to parallel than this have no common perpendicular.
      chance = hn::And(chance, squared > hn::Set(d, 1e-10));
      const auto known = hn::Set(d, best.depth * std::abs(best.depth));
      chance = hn::And(chance, overlap * hn::Abs(overlap) < known * squared);
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(d, chance, bits);
      if (bits[0] == 0) continue;
      hn::Store(overlap, d, overlap_of);
      hn::Store(squared, d, squared_of);
      hn::Store(axis.x, d, axis_of[0]);
      hn::Store(axis.y, d, axis_of[1]);
      hn::Store(axis.z, d, axis_of[2]);
      for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
        if ((bits[0] >> lane & 1) == 0 || i + lane >= hull.edge_count()) continue;
        const double inverse = 1 / std::sqrt(squared_of[lane]);
        const Vec3d normal{axis_of[0][lane] * inverse, axis_of[1][lane] * inverse, axis_of[2][lane] * inverse};
        // Nearly parallel edges give a direction along which other vertices may be farther.
        const double value = squared_of[lane] > Rounding<double>::sure_sine_squared
                                 ? overlap_of[lane] * inverse
                                 : extent_along(normal).high - lowest_of(from, from + edge, opposite, normal);
        if (!best.take(value, normal, at_least)) return false;
      }
    }
    return true;
  }
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
