#include "gateway/protocol/shape_radius.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <variant>

namespace ringfence::gateway {
namespace {

double length(const Vec3f& v) noexcept {
  const double x = v.x, y = v.y, z = v.z;
  return std::sqrt(x * x + y * y + z * z);
}

double farthest(std::span<const Vec3f> points) noexcept {
  double radius = 0;
  for (const Vec3f& point : points) radius = std::max(radius, length(point));
  return radius;
}

/// The corner of the box on the shape's axes that is farthest from the origin.
double radius_of(const SupportFunction& function) {
  const auto extent = [&](const Vec3f& positive, const Vec3f& negative, float Vec3f::*axis) {
    return std::max(std::abs(function.support(positive).*axis), std::abs(function.support(negative).*axis));
  };
  return length({extent({1, 0, 0}, {-1, 0, 0}, &Vec3f::x), extent({0, 1, 0}, {0, -1, 0}, &Vec3f::y),
                 extent({0, 0, 1}, {0, 0, -1}, &Vec3f::z)});
}

struct Radius {
  double operator()(const Sphere& sphere) const { return sphere.radius; }
  double operator()(const Box& box) const { return length(box.half_extents); }
  double operator()(const Capsule& capsule) const { return double{capsule.radius} + capsule.half_height; }
  double operator()(const ConvexHull& hull) const { return farthest(hull.points); }
  double operator()(const TriangleMesh& mesh) const { return farthest(mesh.vertices); }
  double operator()(const SupportShape& support) const { return radius_of(*support.function); }
};

}  // namespace

double shape_radius(const ShapeDescription& shape) { return std::visit(Radius{}, shape); }

}  // namespace ringfence::gateway
