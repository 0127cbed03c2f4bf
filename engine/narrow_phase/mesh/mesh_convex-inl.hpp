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

template <class D>
HWY_INLINE Vector<D> spread_out(D d, Vec3d p) {
  return {at(d, p.x), at(d, p.y), at(d, p.z)};
}

constexpr int next_of(int i) { return i == 2 ? 0 : i + 1; }

/// Minimum and maximum of the three corners along an axis.
template <class D>
struct Span {
  hn::Vec<D> low, high;

  static HWY_INLINE Span of(hn::Vec<D> p, hn::Vec<D> q, hn::Vec<D> r) {
    return {hn::Min(p, hn::Min(q, r)), hn::Max(p, hn::Max(q, r))};
  }
  static HWY_INLINE Span of(hn::Vec<D> p, hn::Vec<D> q) { return {hn::Min(p, q), hn::Max(p, q)}; }
  /// The overlap with the interval [-half, half], for a translation in either direction.
  HWY_INLINE hn::Vec<D> overlap(hn::Vec<D> half) const { return half - hn::Max(low, hn::Neg(high)); }
};

/// A ball.
struct BallInMesh {
  static constexpr std::size_t max_corners = 1;
  Vec3d centre;
  double radius;

  static BallInMesh of(const geometry::ShapeView&, const geometry::ShapeRow& row, const MeshFrame& frame) {
    return {frame.position, double{row.size[0]}};
  }

  template <class D>
  HWY_INLINE hn::Mask<D> boxes(D d, const BoxLanes<D>& in, float floor) const {
    const auto zero = hn::Zero(d);
    const Vector<D> apart = subtract(d, in.centre, spread_out(d, centre));
    const Vector<D> gap{hn::Max(hn::Abs(apart.x) - in.half.x, zero), hn::Max(hn::Abs(apart.y) - in.half.y, zero),
                        hn::Max(hn::Abs(apart.z) - in.half.z, zero)};
    const float max_distance = static_cast<float>(radius) - floor;
    return dot(d, gap, gap) <= hn::Set(d, max_distance * max_distance);
  }

  /// By the distance to the plane and, within the plane, to the lines of the edges. This bound is also right for
  /// slivers.
  template <class D>
  HWY_INLINE hn::Mask<D> triangles(D d, const TriangleLanes<D>& in, float floor) const {
    const float max_distance = static_cast<float>(radius) - floor;
    const Vector<D> c = spread_out(d, centre);
    const auto height = dot(d, in.normal, subtract(d, c, in.corner[0]));
    const auto left = hn::Set(d, max_distance * max_distance) - height * height;
    auto alive = left >= hn::Zero(d);
    for (int i = 0; i < 3; ++i) {
      const Vector<D> edge = subtract(d, in.corner[next_of(i)], in.corner[i]);
      const auto out = dot(d, cross(d, edge, in.normal), subtract(d, c, in.corner[i]));
      alive = hn::And(alive, hn::Or(out <= hn::Zero(d), out * out <= left * dot(d, edge, edge)));
    }
    return alive;
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

/// A placed box. Also used as the bound of a capsule or a hull against boxes.
struct BoxInMesh {
  static constexpr std::size_t max_corners = 8;
  Vec3d centre;
  geometry::RotationD rotation;
  double half[3];

  static BoxInMesh of(const geometry::ShapeView&, const geometry::ShapeRow& row, const MeshFrame& frame) {
    return {frame.position, frame.rotation, {double{row.size[0]}, double{row.size[1]}, double{row.size[2]}}};
  }

  template <class D>
  HWY_INLINE hn::Mask<D> boxes(D d, const BoxLanes<D>& in, float floor) const {
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
      const Vector<D> size{hn::Abs(axis.x), hn::Abs(axis.y), hn::Abs(axis.z)};
      overlap = hn::Min(overlap, at(d, half[k]) + dot(d, size, in.half) - hn::Abs(dot(d, axis, apart)));
    }
    return overlap >= hn::Set(d, floor);
  }

  /// All axes of the separating axis test, in the axes of the box.
  template <class D>
  HWY_INLINE hn::Mask<D> triangles(D d, const TriangleLanes<D>& in, float floor) const {
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
    const Vector<D> spread{hn::Abs(n.x), hn::Abs(n.y), hn::Abs(n.z)};
    auto overlap = dot(d, spread, size) - hn::Abs(dot(d, n, p[0]));
    overlap = hn::Min(overlap, Span<D>::of(p[0].x, p[1].x, p[2].x).overlap(size.x));
    overlap = hn::Min(overlap, Span<D>::of(p[0].y, p[1].y, p[2].y).overlap(size.y));
    overlap = hn::Min(overlap, Span<D>::of(p[0].z, p[1].z, p[2].z).overlap(size.z));
    auto alive = overlap >= least;
    if (hn::AllFalse(d, alive)) return alive;
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
    return alive;
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
  BoxInMesh bounding_box;

  static CapsuleInMesh of(const geometry::ShapeView&, const geometry::ShapeRow& row, const MeshFrame& frame) {
    const double radius = double{row.size[0]}, half_height = double{row.size[1]};
    const Vec3d up = Vec3d{frame.rotation.m[0][2], frame.rotation.m[1][2], frame.rotation.m[2][2]} * half_height;
    return {{frame.position - up, frame.position + up},
            radius,
            {frame.position, frame.rotation, {radius, radius, radius + half_height}}};
  }

  template <class D>
  HWY_INLINE hn::Mask<D> boxes(D d, const BoxLanes<D>& in, float floor) const {
    return bounding_box.boxes(d, in, floor);
  }

  /// By the plane, the outer sides of the edges within it, and the directions across an edge and the segment.
  template <class D>
  HWY_INLINE hn::Mask<D> triangles(D d, const TriangleLanes<D>& in, float floor) const {
    const Vector<D> p = spread_out(d, ends[0]), q = spread_out(d, ends[1]), along = spread_out(d, ends[1] - ends[0]);
    const float max_distance = static_cast<float>(radius) - floor;
    const auto zero = hn::Zero(d), most = hn::Set(d, max_distance);
    const Vector<D> to_p = subtract(d, p, in.corner[0]), to_q = subtract(d, q, in.corner[0]);
    const auto heights = Span<D>::of(dot(d, in.normal, to_p), dot(d, in.normal, to_q));
    auto alive = hn::Max(heights.low, hn::Neg(heights.high)) <= most;
    for (int i = 0; i < 3; ++i) {
      const Vector<D>&from = in.corner[i], &opposite = in.corner[next_of(next_of(i))];
      const Vector<D> edge = subtract(d, in.corner[next_of(i)], from);
      const Vector<D> out = cross(d, edge, in.normal);
      const Vector<D> p_from = subtract(d, p, from), q_from = subtract(d, q, from);
      const auto beyond = hn::Max(hn::Min(dot(d, out, p_from), dot(d, out, q_from)), zero);
      alive = hn::And(alive, beyond * beyond <= most * most * dot(d, edge, edge));
      const Vector<D> across = cross(d, edge, along);
      const auto segment = Span<D>::of(dot(d, across, p_from), dot(d, across, q_from));
      const auto triangle = Span<D>::of(zero, dot(d, across, subtract(d, opposite, from)));
      const auto apart = hn::Max(hn::Max(segment.low - triangle.high, triangle.low - segment.high), zero);
      const auto squared = dot(d, across, across);
      // If the edges are parallel within 0.1, the direction is too imprecise to exclude anything.
      const auto rough = squared < dot(d, edge, edge) * dot(d, along, along) * hn::Set(d, 0.01f);
      alive = hn::And(alive, hn::Or(rough, apart * apart <= most * most * squared));
    }
    return alive;
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
  HWY_INLINE hn::Mask<D> boxes(D d, const BoxLanes<D>& in, float floor) const {
    return bounding_box.boxes(d, in, floor);
  }
  template <class D>
  HWY_INLINE hn::Mask<D> triangles(D d, const TriangleLanes<D>& in, float floor) const {
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
