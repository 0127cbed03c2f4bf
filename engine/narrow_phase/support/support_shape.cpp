#include "narrow_phase/support/support_shape.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <ccd/ccd.h>

#include "geometry/vector.hpp"
#include "narrow_phase/hull/feature_points.hpp"
#include "narrow_phase/kernel.hpp"
#include "narrow_phase/support/cutting_planes.hpp"

// Tests a shape that is described by a support function against any convex shape or triangle, by libccd's GJK and EPA
// in double. Only the direction of libccd's result is used. The depth is recomputed from the two supports along it, so
// it is never less than what separates the two along the reported normal.

namespace ringfence::narrow_phase {
namespace {

/// A placed convex shape, relative to the first body's position. Of kind mesh: a triangle in the axes of its mesh.
struct Convex {
  const geometry::ShapeRow* row;
  const geometry::Hull* hull = nullptr;
  const geometry::CheckedSupport* function = nullptr;
  geometry::RotationD rotation;
  Vec3d position;
  const Triangle* triangle = nullptr;
  mutable bool failed = false;  ///< set within libccd, through which no exception may pass

  Vec3d local_support(Vec3d d) const {
    const double x = double{row->size[0]}, y = double{row->size[1]}, z = double{row->size[2]};
    const double norm = length(d);
    switch (row->kind) {
      case ShapeKind::sphere:
        return d * (x / norm);
      case ShapeKind::box:
        return {std::copysign(x, d.x), std::copysign(y, d.y), std::copysign(z, d.z)};
      case ShapeKind::capsule:
        return Vec3d{0, 0, std::copysign(y, d.z)} + d * (x / norm);
      case ShapeKind::hull:
        return farthest_vertex(d);
      case ShapeKind::mesh:
        return farthest_corner(d);
      default:
        return to_double(function->support(to_float(d * (1 / norm))));
    }
  }

  Vec3d farthest_vertex(Vec3d d) const {
    std::size_t best = 0;
    double most = dot(d, to_double(hull->vertex(0)));
    for (std::size_t i = 1; i < hull->vertex_count(); ++i) {
      const double value = dot(d, to_double(hull->vertex(i)));
      if (value > most) most = value, best = i;
    }
    return to_double(hull->vertex(best));
  }

  Vec3d farthest_corner(Vec3d d) const {
    const auto& corner = triangle->corner;
    const double p = dot(d, corner[0]), q = dot(d, corner[1]), r = dot(d, corner[2]);
    return p >= q && p >= r ? corner[0] : q >= r ? corner[1] : corner[2];
  }

  Vec3d support(Vec3d d) const { return rotate(rotation, local_support(rotate_inverse(rotation, d))) + position; }

  Vec3d centre() const {
    const Vec3d local = hull != nullptr       ? to_double(hull->centroid())
                        : function != nullptr ? to_double(function->centre())
                        : triangle != nullptr
                            ? (triangle->corner[0] + triangle->corner[1] + triangle->corner[2]) * (1.0 / 3)
                            : Vec3d{};
    return rotate(rotation, local) + position;
  }
};

Convex place(const geometry::ShapeView& shapes, const Body& body, Vec3d position) {
  const geometry::ShapeRow& row = shapes.row(body.shape);
  Convex convex{&row, nullptr, nullptr, geometry::rotation_exact(body.pose.orientation), position};
  if (row.kind == ShapeKind::hull) convex.hull = &shapes.hull(row.index_in_kind);
  if (row.kind == ShapeKind::support) convex.function = &shapes.support(row.index_in_kind);
  return convex;
}

/// Passes the result of `call` to libccd. From the first failure on it passes the body's position, so that libccd ends
/// soon.
template <class Call>
void pass_to_ccd(const Convex& convex, ccd_vec3_t* out, const Call& call) noexcept {
  Vec3d p = convex.position;
  if (!convex.failed) {
    try {
      p = call();
    } catch (const geometry::SupportFailure&) {
      convex.failed = true;
    }
  }
  ccdVec3Set(out, p.x, p.y, p.z);
}

void ccd_support(const void* object, const ccd_vec3_t* direction, ccd_vec3_t* out) {
  const Convex& convex = *static_cast<const Convex*>(object);
  const Vec3d d{direction->v[0], direction->v[1], direction->v[2]};
  // Where two shapes just touch, libccd may pass a direction that is zero or not finite, for which a support function
  // need not have a result.
  const double norm = length(d);
  const bool is_direction = norm > 0 && std::isfinite(norm);
  pass_to_ccd(convex, out,
              [&] { return convex.function != nullptr && !is_direction ? convex.centre() : convex.support(d); });
}

void ccd_centre(const void* object, ccd_vec3_t* out) {
  const Convex& convex = *static_cast<const Convex*>(object);
  pass_to_ccd(convex, out, [&] { return convex.centre(); });
}

/// The overlap along `n`: support of a along `n` plus that of b in the opposite direction.
double overlap_along(const Convex& a, const Convex& b, Vec3d n) { return dot(n, a.support(n)) - dot(n, b.support(-n)); }

bool finite_direction(const ccd_vec3_t& d) {
  const double squared = d.v[0] * d.v[0] + d.v[1] * d.v[1] + d.v[2] * d.v[2];
  return std::isfinite(squared) && squared > 1e-12;
}

struct Direction {
  Vec3d n;  ///< unit, from a to b
  double depth;
};

/// Directions on the whole sphere, 12 to 25 degrees apart: a spiral from pole to pole with golden-angle steps. Computed
/// by multiplications only, so that every machine gets the same directions.
constexpr std::size_t sampled_directions = 96;
constexpr double golden_cosine = -0.73736887807831963, golden_sine = 0.67549029426152396;
std::array<Vec3d, sampled_directions> spiral() {
  std::array<Vec3d, sampled_directions> out;
  double x = 1, y = 0;
  for (std::size_t i = 0; i < sampled_directions; ++i) {
    const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(sampled_directions);
    const double ring = std::sqrt(1 - z * z);
    out[i] = {ring * x, ring * y, z};
    const double turned = x * golden_cosine - y * golden_sine;
    y = x * golden_sine + y * golden_cosine;
    x = turned;
  }
  return out;
}

/// Two unit vectors that form an orthonormal basis with a given one.
struct AxisFrame {
  Vec3d u, v;
  explicit AxisFrame(Vec3d n) {
    const Vec3d across = std::abs(n.x) < 0.6 ? cross(n, Vec3d{1, 0, 0}) : cross(n, Vec3d{0, 1, 0});
    u = across * (1 / length(across));
    v = cross(n, u);
  }
};

/// The best few directions, in ascending order of overlap.
class BestDirections {
 public:
  BestDirections(const Convex& a, const Convex& b) : a_(a), b_(b) {}

  /// Returns false if the direction separates the two shapes.
  bool take(Vec3d direction) {
    const Vec3d n = direction * (1 / length(direction));
    Direction next{n, overlap_along(a_, b_, n)};
    if (next.depth < 0) return false;
    for (Direction& known : best_) {
      if (next.depth < known.depth) std::swap(next, known);
    }
    return true;
  }

  /// Refines each direction and returns the best. False if one separates the two shapes.
  bool refine(Direction& out) {
    out.depth = 1e300;
    for (Direction& start : best_) {
      if (start.depth > 1e299) break;
      if (!refine_one(start)) return false;
      if (start.depth < out.depth) out = start;
    }
    return true;
  }

 private:
  /// Moves to the direction that has the least overlap according to the support points so far. The step width is halved
  /// whenever this direction is not an improvement.
  bool refine_one(Direction& best) const {
    CuttingPlanes planes;
    planes.add(difference(best.n));
    double widest = 0.25;  // as a tangent
    for (int i = 0; i < 60 && widest > 1e-8; ++i) {
      const AxisFrame frame(best.n);
      const Vec3d direction = planes.lowest(best.n, frame.u, frame.v, widest);
      const Vec3d n = direction * (1 / length(direction));
      const Vec3d point = difference(n);
      planes.add(point);
      const double depth = dot(n, point);
      if (depth < 0) return false;
      if (depth < best.depth) {
        best = {n, depth};
      } else {
        widest *= 0.5;
      }
    }
    return true;
  }
  /// The support point of the Minkowski difference.
  Vec3d difference(Vec3d n) const { return a_.support(n) - b_.support(-n); }

  const Convex& a_;
  const Convex& b_;
  std::array<Direction, 5> best_{{{{}, 1e300}, {{}, 1e300}, {{}, 1e300}, {{}, 1e300}, {{}, 1e300}}};
};

/// Finds the direction of least depth. False if a direction separates the two shapes.
///
/// libccd's result is only one of the start directions: on curved surfaces it stops early, sometimes far from the
/// minimum.
bool find_direction(const Convex& a, const Convex& b, double small, Direction& best) {
  BestDirections list(a, b);
  const Vec3d between = b.centre() - a.centre();
  if (length(between) > 1e-9 * small && !list.take(between)) return false;

  ccd_t ccd;
  CCD_INIT(&ccd);
  ccd.support1 = ccd.support2 = ccd_support;
  ccd.center1 = ccd.center2 = ccd_centre;
  ccd.max_iterations = 100;
  ccd.epa_tolerance = 1e-5 * small;
  ccd_real_t depth;
  ccd_vec3_t direction, position;
  const bool overlaps = ccdGJKPenetration(&a, &b, &ccd, &depth, &direction, &position) == 0;
  if (a.failed || b.failed) throw geometry::SupportFailure();
  if (overlaps && finite_direction(direction)) {
    const Vec3d d{direction.v[0], direction.v[1], direction.v[2]};
    if (!list.take(d) || !list.take(-d)) return false;
  }
  static const std::array<Vec3d, sampled_directions> around = spiral();
  for (const Vec3d& d : around) {
    if (!list.take(d)) return false;
  }
  // The normal of a flat side of a box or hull is a sharp minimum between the sampled directions.
  for (const Convex* own : {&a, &b}) {
    const double sign = own == &a ? 1 : -1;
    if (own->row->kind == ShapeKind::box) {
      for (const Vec3d& d : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
        const Vec3d n = rotate(own->rotation, d);
        if (!list.take(n) || !list.take(-n)) return false;
      }
    }
    if (own->triangle != nullptr) {
      const auto& corner = own->triangle->corner;
      const Vec3d n = cross(corner[1] - corner[0], corner[2] - corner[0]);
      if (!list.take(n) || !list.take(-n)) return false;
    }
    for (std::size_t f = 0; own->hull != nullptr && f < own->hull->face_count(); ++f) {
      if (!list.take(rotate(own->rotation, to_double(own->hull->normal(f))) * sign)) return false;
    }
  }
  return list.refine(best);
}

/// The points of the feature that is farthest along `n`: the support points of nearby directions that are almost as
/// far.
struct Feature {
  std::array<Vec3d, 9> points;
  std::size_t count = 0;
  double height;

  Feature(const Convex& convex, Vec3d n, double slack) {
    const AxisFrame frame(n);
    points[count++] = convex.support(n);
    height = dot(n, points[0]);
    for (int i = 0; i < 8; ++i) {
      constexpr double x[] = {1, 1, 0, -1, -1, -1, 0, 1}, y[] = {0, 1, 1, 1, 0, -1, -1, -1};
      const Vec3d p = convex.support(n + frame.u * (1e-4 * x[i]) + frame.v * (1e-4 * y[i]));
      if (dot(n, p) >= height - slack) points[count++] = p;
    }
  }
  std::span<const Vec3d> span() const { return {points.data(), count}; }
};

constexpr geometry::RotationD no_rotation{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

Convex place(const geometry::CheckedSupport& function, const MeshFrame& frame) {
  static const geometry::ShapeRow row{.kind = ShapeKind::support};
  return {&row, nullptr, &function, frame.rotation, frame.position};
}

}  // namespace

Penetration support_penetration(const Triangle& triangle, const geometry::CheckedSupport& function,
                                const MeshFrame& frame, double bounding_radius, double at_least) {
  static const geometry::ShapeRow row{.kind = ShapeKind::mesh};
  const Convex a{&row, nullptr, nullptr, no_rotation, {}, &triangle}, b = place(function, frame);
  // The triangle's own plane bounds the depth at the cost of two support points.
  const Vec3d across = cross(triangle.corner[1] - triangle.corner[0], triangle.corner[2] - triangle.corner[0]);
  const Vec3d n = across * (1 / length(across));
  if (std::min(overlap_along(a, b, n), overlap_along(a, b, -n)) < at_least) return {};
  Direction best;
  if (!find_direction(a, b, bounding_radius, best) || best.depth < at_least) return {};
  return {best.depth, best.n};
}

std::size_t support_feature(const geometry::CheckedSupport& function, const MeshFrame& frame, Vec3d direction,
                            double slack, Vec3d* out) {
  static_assert(std::tuple_size_v<decltype(Feature::points)> == max_support_feature);
  const Feature feature(place(function, frame), direction, slack);
  std::copy_n(feature.points.begin(), feature.count, out);
  return feature.count;
}

namespace {

/// Writes the contact of a pair, if there is one, and returns the end of the output. Throws SupportFailure.
PairContact* test_pair(const KernelInput& input, const KernelPair& pair, PairContact* out) {
  const Body& first = input.bodies[pair.first];
  const Body& second = input.bodies[pair.second];
  const Vec3d offset = second.pose.position - first.pose.position;
  const Convex a = place(input.shapes, first, {}), b = place(input.shapes, second, offset);
  const double small = double{std::min(a.row->bounding_radius, b.row->bounding_radius)};
  Direction best;
  if (!find_direction(a, b, small, best)) return out;
  const Feature of_a(a, best.n, 1e-5 * small), of_b(b, -best.n, 1e-5 * small);
  const Vec3d common = common_point(of_a.span(), of_b.span(), best.n);
  Vec3d normal = best.n, point = common + best.n * (0.5 * (of_a.height - of_b.height) - dot(best.n, common));
  if (pair.flipped != 0) {
    normal = -normal;
    point = point - offset;
  }
  const Vec3f n = to_float(normal), p = to_float(point);
  *out = {pair.pair,
          static_cast<float>(best.depth) + 0.0f,
          {n.x + 0.0f, n.y + 0.0f, n.z + 0.0f},
          {p.x + 0.0f, p.y + 0.0f, p.z + 0.0f}};
  return out + 1;
}

}  // namespace

PairContact* test_support_any(const KernelInput& input, PairContact* out, KindCounters& counters) {
  for (const KernelPair& pair : input.pairs) {
    try {
      out = test_pair(input, pair, out);
    } catch (const geometry::SupportFailure&) {
      ++counters.failed;
    }
  }
  return out;
}

}  // namespace ringfence::narrow_phase
