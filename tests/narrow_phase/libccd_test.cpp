#include <algorithm>
#include <cmath>
#include <optional>

#include <ccd/ccd.h>
#include <doctest/doctest.h>

#include "geometry/vector.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/pair_world.hpp"

namespace ringfence::narrow_phase_test {
namespace {

/// A placed convex shape for libccd. It uses only the description of the shape, nothing that the kernels prepare.
struct Placed {
  const ShapeDescription& shape;
  geometry::RotationD rotation;
  Vec3d position;

  Vec3d local_support(Vec3d d) const {
    const double length = ringfence::length(d);
    const Vec3d unit = length > 0 ? d * (1 / length) : Vec3d{1, 0, 0};
    if (const auto* sphere = std::get_if<Sphere>(&shape)) return unit * double{sphere->radius};
    if (const auto* box = std::get_if<Box>(&shape)) {
      return {std::copysign(double{box->half_extents.x}, d.x), std::copysign(double{box->half_extents.y}, d.y),
              std::copysign(double{box->half_extents.z}, d.z)};
    }
    if (const auto* capsule = std::get_if<Capsule>(&shape)) {
      return Vec3d{0, 0, std::copysign(double{capsule->half_height}, d.z)} + unit * double{capsule->radius};
    }
    const auto& points = std::get<ConvexHull>(shape).points;
    const auto height = [&](Vec3f p) { return dot(to_double(p), d); };
    return to_double(
        *std::max_element(points.begin(), points.end(), [&](Vec3f p, Vec3f q) { return height(p) < height(q); }));
  }
  Vec3d support(Vec3d d) const { return rotate(rotation, local_support(rotate_inverse(rotation, d))) + position; }
};

void support(const void* object, const ccd_vec3_t* direction, ccd_vec3_t* out) {
  const Vec3d p = static_cast<const Placed*>(object)->support({direction->v[0], direction->v[1], direction->v[2]});
  ccdVec3Set(out, p.x, p.y, p.z);
}

/// The depth along the direction that GJK and EPA of libccd find; empty if they find no contact. The depth that libccd
/// returns is not used, because it is too small on curved surfaces.
std::optional<double> depth_by_libccd(const Placed& a, const Placed& b) {
  ccd_t ccd;
  CCD_INIT(&ccd);
  ccd.support1 = ccd.support2 = support;
  ccd.max_iterations = 200;
  ccd.epa_tolerance = 1e-6;
  ccd_real_t depth = 0;
  ccd_vec3_t direction, place;
  if (ccdGJKPenetration(&a, &b, &ccd, &depth, &direction, &place) != 0) return std::nullopt;
  const Vec3d d{direction.v[0], direction.v[1], direction.v[2]};
  const Vec3d n = d * (1 / length(d));
  const auto overlap_along = [&](Vec3d axis) { return dot(axis, a.support(axis)) - dot(axis, b.support(-axis)); };
  return std::min(overlap_along(n), overlap_along(-n));
}

}  // namespace

TEST_CASE("libccd agrees on contact and depth for every pair of convex kinds") {
  constexpr ShapeKind kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull};
  for (const ShapeKind p : kinds) {
    for (const ShapeKind q : kinds) {
      const std::uint64_t seed = 41;
      INFO(name_of(p), " ", name_of(q), ", seed ", seed);
      const PairWorld world = ordinary_pairs(p, q, 1000, seed);
      narrow_phase::NarrowPhase narrow_phase(world.shapes());
      std::vector<double> depth(world.pairs.size(), -1);
      for (const narrow_phase::PairContact& contact : narrow_phase.test(world.bodies, world.pairs)) {
        depth[contact.pair] = double{contact.depth};
      }
      std::size_t touching = 0, different = 0, deeper = 0, same = 0;
      for (std::size_t i = 0; i < world.pairs.size(); ++i) {
        const narrow_phase::Body &a = world.bodies[world.pairs[i].a], &b = world.bodies[world.pairs[i].b];
        const Placed placed_a{world.shapes().description(a.shape), geometry::rotation_exact(a.pose.orientation), {}};
        const Placed placed_b{world.shapes().description(b.shape), geometry::rotation_exact(b.pose.orientation),
                              b.pose.position - a.pose.position};
        const std::optional<double> libccd_depth = depth_by_libccd(placed_a, placed_b);
        // libccd decides by iteration: if the depth is not larger than this, either decision is possible.
        const double tolerance = 1e-3 * double{std::min(world.shapes().row(a.shape).bounding_radius,  //
                                                        world.shapes().row(b.shape).bounding_radius)};
        different += libccd_depth.value_or(-1) > tolerance && depth[i] < 0;
        different += depth[i] > tolerance && !libccd_depth;
        if (!libccd_depth || depth[i] < 0) continue;
        ++touching;
        // Our depth is the least of all directions, so it is never larger than the depth along libccd's direction. In
        // most cases the two are equal.
        deeper += depth[i] > *libccd_depth + 0.1 * tolerance;
        same += std::abs(depth[i] - *libccd_depth) < 10 * tolerance;
      }
      CHECK(touching > 100);
      CHECK(different == 0);
      CHECK(deeper == 0);
      // EPA is exact for flat sides and stops early on curved ones.
      const auto flat = [](ShapeKind kind) { return kind == ShapeKind::box || kind == ShapeKind::hull; };
      if (flat(p) && flat(q)) CHECK(same * 10 > touching * 9);
    }
  }
}

}  // namespace ringfence::narrow_phase_test
