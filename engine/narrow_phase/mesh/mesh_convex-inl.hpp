// Convex shapes that are tested against a mesh, placed in the mesh's axes: for each, the tests in lanes that exclude
// boxes and triangles, and the exact penetration. Included once for each Highway target.
//
// Each shape also lists the points of its core, at most `max_corners`, from which the contact point with a triangle is
// computed, and the distance of its surface from the core.

#if defined(RINGFENCE_NARROW_PHASE_MESH_CONVEX_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_MESH_CONVEX_INL
#undef RINGFENCE_NARROW_PHASE_MESH_CONVEX_INL
#else
#define RINGFENCE_NARROW_PHASE_MESH_CONVEX_INL
#endif

#include "geometry/shape_table.hpp"
#include "narrow_phase/mesh/mesh_frame.hpp"
#include "narrow_phase/mesh/mesh_walk-inl.hpp"
#include "narrow_phase/support/support_shape.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// A ball.
struct BallInMesh {
  static constexpr std::size_t max_corners = 1;
  Vec3d centre;
  double radius;

  static BallInMesh of(const geometry::ShapeView&, const geometry::ShapeRow& row, const MeshFrame& frame) {
    return {frame.position, double{row.size[0]}};
  }

  template <class D>
  HWY_INLINE hn::Vec<D> boxes(D d, const BoxLanes<D>& in, float) const {
    const auto zero = hn::Zero(d);
    const Vector<D> apart = subtract(d, in.centre, spread_out(d, centre));
    const Vector<D> gap{hn::Max(hn::Abs(apart.x) - in.half.x, zero), hn::Max(hn::Abs(apart.y) - in.half.y, zero),
                        hn::Max(hn::Abs(apart.z) - in.half.z, zero)};
    return at(d, radius) - hn::Sqrt(dot(d, gap, gap));
  }

  /// By the plane and the direction to the nearest point of the edges.
  template <class D>
  HWY_INLINE hn::Vec<D> triangles(D d, const TriangleLanes<D>& in, float floor) const {
    const Vector<D> c = spread_out(d, centre);
    Vector<D> corner[3];
    for (int i = 0; i < 3; ++i) corner[i] = subtract(d, in.corner[i], c);
    const auto by_plane = at(d, radius) - hn::Abs(dot(d, in.normal, corner[0]));
    if (hn::AllTrue(d, by_plane < hn::Set(d, floor))) return by_plane;
    NearDirection<D> near(d);
    for (int i = 0; i < 3; ++i) {
      const Vector<D> edge = subtract(d, corner[next_of(i)], corner[i]);
      const auto part = part_of_edge(d, hn::Neg(dot(d, corner[i], edge)), dot(d, edge, edge));
      near.take(d, add(d, corner[i], scale(d, edge, part)));
    }
    const Vector<D>& u = near.get();
    const auto nearest = Span<D>::of(dot(d, u, corner[0]), dot(d, u, corner[1]), dot(d, u, corner[2])).low;
    return hn::Min(by_plane, at(d, radius) + near.bound(d, hn::Zero(d), hn::Neg(nearest)));
  }

  Penetration penetration(const Triangle& triangle, double at_least) const {
    return ball_penetration(triangle, centre, radius, at_least);
  }

  std::size_t corners(const Penetration&, Vec3d* out) const {
    out[0] = centre;
    return 1;
  }
  double rounding() const { return radius; }
};

/// A placed box. Also used as the bound of a hull.
struct BoxInMesh {
  static constexpr std::size_t max_corners = 8;
  Vec3d centre;
  geometry::RotationD rotation;
  double half[3];

  static BoxInMesh of(const geometry::ShapeView&, const geometry::ShapeRow& row, const MeshFrame& frame) {
    return {frame.position, frame.rotation, {double{row.size[0]}, double{row.size[1]}, double{row.size[2]}}};
  }

  double largest_half() const { return std::max(half[0], std::max(half[1], half[2])); }

  template <class D>
  HWY_INLINE hn::Vec<D> boxes(D d, const BoxLanes<D>& in, float) const {
    const Vector<D> apart = subtract(d, in.centre, spread_out(d, centre));
    const hn::Vec<D> away[3] = {apart.x, apart.y, apart.z}, own[3] = {in.half.x, in.half.y, in.half.z};
    auto overlap = hn::Set(d, 1e30f);
    for (int i = 0; i < 3; ++i) {
      const double extent = half[0] * std::abs(rotation.m[i][0]) + half[1] * std::abs(rotation.m[i][1]) +
                            half[2] * std::abs(rotation.m[i][2]);
      overlap = hn::Min(overlap, own[i] + at(d, extent) - hn::Abs(away[i]));
    }
    for (int k = 0; k < 3; ++k) {
      const Vector<D> axis{at(d, rotation.m[0][k]), at(d, rotation.m[1][k]), at(d, rotation.m[2][k])};
      overlap = hn::Min(overlap, at(d, half[k]) + reach_along(d, axis, in.half) - hn::Abs(dot(d, axis, apart)));
    }
    return overlap;
  }

  /// All axes of the separating axis test, in the axes of the box.
  template <class D>
  HWY_INLINE hn::Vec<D> triangles(D d, const TriangleLanes<D>& in, float floor) const {
    const auto least = hn::Set(d, floor);
    Rotation<D> r;
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) r.m[i][k] = at(d, rotation.m[i][k]);
    }
    const Vector<D> size{at(d, half[0]), at(d, half[1]), at(d, half[2])};
    const Vector<D> c = spread_out(d, centre);
    Vector<D> p[3];
    for (int i = 0; i < 3; ++i) p[i] = unrotate(d, r, subtract(d, in.corner[i], c));
    const Vector<D> n = unrotate(d, r, in.normal);
    auto overlap = reach_along(d, n, size) - hn::Abs(dot(d, n, p[0]));
    overlap = hn::Min(overlap, Span<D>::of(p[0].x, p[1].x, p[2].x).overlap(size.x));
    overlap = hn::Min(overlap, Span<D>::of(p[0].y, p[1].y, p[2].y).overlap(size.y));
    overlap = hn::Min(overlap, Span<D>::of(p[0].z, p[1].z, p[2].z).overlap(size.z));
    auto alive = overlap >= least;
    if (hn::AllFalse(d, alive)) return overlap;
    for (int i = 0; i < 3; ++i) {
      const Vector<D>&from = p[i], &opposite = p[next_of(next_of(i))];
      const Vector<D> e = subtract(d, p[next_of(i)], from);
      const Vector<D> length{hn::Abs(e.x), hn::Abs(e.y), hn::Abs(e.z)};
      const auto xx = e.x * e.x, yy = e.y * e.y, zz = e.z * e.z;
      const auto along_x = Span<D>::of(e.z * from.y - e.y * from.z, e.z * opposite.y - e.y * opposite.z);
      const auto along_y = Span<D>::of(e.x * from.z - e.z * from.x, e.x * opposite.z - e.z * opposite.x);
      const auto along_z = Span<D>::of(e.y * from.x - e.x * from.y, e.y * opposite.x - e.x * opposite.y);
      alive = hn::And(alive, reaches(d, along_x.overlap(length.z * size.y + length.y * size.z), yy + zz, floor));
      alive = hn::And(alive, reaches(d, along_y.overlap(length.x * size.z + length.z * size.x), zz + xx, floor));
      alive = hn::And(alive, reaches(d, along_z.overlap(length.y * size.x + length.x * size.y), xx + yy, floor));
    }
    return hn::IfThenElse(alive, overlap, hn::Set(d, -1e30f));
  }

  Penetration penetration(const Triangle& triangle, double at_least) const {
    return box_penetration(triangle, centre, rotation, half, at_least);
  }

  std::size_t corners(const Penetration&, Vec3d* out) const {
    for (int i = 0; i < 8; ++i) {
      const Vec3d corner{(i & 1) != 0 ? half[0] : -half[0], (i & 2) != 0 ? half[1] : -half[1],
                         (i & 4) != 0 ? half[2] : -half[2]};
      out[i] = centre + geometry::rotate(rotation, corner);
    }
    return 8;
  }
  double rounding() const { return 0; }
};

/// A capsule: the points within a radius of a segment.
struct CapsuleInMesh {
  static constexpr std::size_t max_corners = 2;
  Vec3d ends[2];
  double radius;

  static CapsuleInMesh of(const geometry::ShapeView&, const geometry::ShapeRow& row, const MeshFrame& frame) {
    const Vec3d axis{frame.rotation.m[0][2], frame.rotation.m[1][2], frame.rotation.m[2][2]};
    const Vec3d up = axis * double{row.size[1]};
    return {{frame.position - up, frame.position + up}, double{row.size[0]}};
  }

  /// By the mesh's axes and the direction from the segment to the middle of the box.
  template <class D>
  HWY_INLINE hn::Vec<D> boxes(D d, const BoxLanes<D>& in, float floor) const {
    const Vec3d middle = (ends[0] + ends[1]) * 0.5;
    const Vector<D> apart = subtract(d, in.centre, spread_out(d, middle)), end = spread_out(d, ends[1] - middle);
    const auto overlap = [&](hn::Vec<D> size, hn::Vec<D> of_end, hn::Vec<D> distance)
                             HWY_ATTR { return size + hn::Abs(of_end) - hn::Abs(distance); };
    const auto bound = hn::Min(overlap(in.half.x, end.x, apart.x),
                               hn::Min(overlap(in.half.y, end.y, apart.y), overlap(in.half.z, end.z, apart.z)));
    if (hn::AllTrue(d, at(d, radius) + bound < hn::Set(d, floor))) return at(d, radius) + bound;
    // The segment is symmetric, so the side of the middle on which the nearest point lies is given by the sign.
    const auto along = dot(d, apart, end);
    const auto part = hn::CopySign(part_of_edge(d, hn::Abs(along), dot(d, end, end)), along);
    NearDirection<D> near(d);
    near.take(d, subtract(d, apart, scale(d, end, part)));
    const Vector<D>& u = near.get();
    const auto along_u = overlap(reach_along(d, u, in.half), dot(d, u, end), dot(d, u, apart));
    return at(d, radius) + near.bound(d, bound, along_u);
  }

  /// By the plane, the directions across an edge and the segment, and that between the nearest points of the edges and
  /// the segment.
  template <class D>
  HWY_INLINE hn::Vec<D> triangles(D d, const TriangleLanes<D>& in, float floor) const {
    const auto zero = hn::Zero(d);
    const Vector<D> p = spread_out(d, ends[0]), along = spread_out(d, ends[1] - ends[0]);
    const auto length_squared = dot(d, along, along);
    // Relative to the first end of the segment.
    Vector<D> corner[3];
    for (int i = 0; i < 3; ++i) corner[i] = subtract(d, in.corner[i], p);
    // The overlap of the segment and the triangle; negative where they are apart.
    const auto overlap = [&](const Vector<D>& axis) HWY_ATTR {
      const auto segment = Span<D>::of(zero, dot(d, axis, along));
      const auto triangle = Span<D>::of(dot(d, axis, corner[0]), dot(d, axis, corner[1]), dot(d, axis, corner[2]));
      return hn::Min(triangle.high - segment.low, segment.high - triangle.low);
    };
    auto bound = overlap(in.normal);
    if (hn::AllTrue(d, at(d, radius) + bound < hn::Set(d, floor))) return at(d, radius) + bound;
    NearDirection<D> near(d);
    for (int i = 0; i < 3; ++i) {
      const Vector<D>& from = corner[i];
      const Vector<D> edge = subtract(d, corner[next_of(i)], from);
      const auto edge_squared = dot(d, edge, edge), both = dot(d, edge, along);
      const Vector<D> axis = cross(d, edge, along);
      const auto squared = dot(d, axis, axis);
      // Nearly parallel edges give an imprecise direction, along which the overlap is a bound too.
      const auto known = squared > hn::Set(d, least_squared);
      bound = hn::IfThenElse(known, hn::Min(bound, overlap(axis) / hn::Sqrt(squared)), bound);
      // Near points of the two: the nearest unless they are nearly parallel.
      const auto from_edge = dot(d, from, edge), from_along = dot(d, from, along);
      const auto first = part_of_edge(d, both * from_along - from_edge * length_squared, squared);
      const auto on_segment = part_of_edge(d, both * first + from_along, length_squared);
      const auto on_edge = part_of_edge(d, both * on_segment - from_edge, edge_squared);
      near.take(d, subtract(d, add(d, from, scale(d, edge, on_edge)), scale(d, along, on_segment)));
    }
    return at(d, radius) + near.bound(d, bound, overlap(near.get()));
  }

  Penetration penetration(const Triangle& triangle, double at_least) const {
    return capsule_penetration(triangle, ends, radius, at_least);
  }

  std::size_t corners(const Penetration&, Vec3d* out) const {
    out[0] = ends[0];
    out[1] = ends[1];
    return 2;
  }
  double rounding() const { return radius; }
};

/// A shape that is described by a support function; the exact test uses libccd.
struct SupportInMesh {
  static constexpr std::size_t max_corners = max_support_feature;
  const geometry::CheckedSupport* function;
  MeshFrame frame;
  BoxInMesh bounding_box;
  double bounding_radius;

  static SupportInMesh of(const geometry::ShapeView& shapes, const geometry::ShapeRow& row, const MeshFrame& frame) {
    const geometry::CheckedSupport& f = shapes.support(row.index_in_kind);
    const Vec3d high{double{f.support({1, 0, 0}).x}, double{f.support({0, 1, 0}).y}, double{f.support({0, 0, 1}).z}};
    const Vec3d low{double{f.support({-1, 0, 0}).x}, double{f.support({0, -1, 0}).y}, double{f.support({0, 0, -1}).z}};
    const Vec3d half = (high - low) * 0.5;
    return {&f,
            frame,
            {frame.to_mesh((low + high) * 0.5), frame.rotation, {half.x, half.y, half.z}},
            double{row.bounding_radius}};
  }

  template <class D>
  HWY_INLINE hn::Vec<D> boxes(D d, const BoxLanes<D>& in, float floor) const {
    return bounding_box.boxes(d, in, floor);
  }
  template <class D>
  HWY_INLINE hn::Vec<D> triangles(D d, const TriangleLanes<D>& in, float floor) const {
    return bounding_box.triangles(d, in, floor);
  }

  Penetration penetration(const Triangle& triangle, double at_least) const {
    return support_penetration(triangle, *function, frame, bounding_radius, at_least);
  }

  std::size_t corners(const Penetration& penetration, Vec3d* out) const {
    return support_feature(*function, frame, -penetration.normal, 1e-5 * bounding_radius, out);
  }
  double rounding() const { return 0; }
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
