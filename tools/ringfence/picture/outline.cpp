#include "picture/outline.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>

#include "geometry/vector.hpp"

namespace ringfence::tools {
namespace {

using geometry::RotationD;

constexpr int sides_of_circle = 24;

/// The points of a shape whose projections have the hull of its outline.
class Projection {
 public:
  explicit Projection(Quat orientation) : rotation_(geometry::rotation_exact(orientation)) {}

  void add(Vec3d point) {
    const Vec3d turned = rotate(rotation_, point);
    points_.push_back({turned.x, turned.y});
  }
  void add(Vec3f point) { add(to_double(point)); }

  void add(const Box& box) {
    const Vec3d half = to_double(box.half_extents);
    for (int corner = 0; corner < 8; ++corner)
      add(Vec3d{corner & 1 ? half.x : -half.x, corner & 2 ? half.y : -half.y, corner & 4 ? half.z : -half.z});
  }
  void add(const Capsule& capsule) {
    for (const double end : {-double{capsule.half_height}, double{capsule.half_height}}) {
      const Vec3d centre = rotate(rotation_, {0, 0, end});
      for_each_direction([&](double x, double y) {
        points_.push_back({centre.x + double{capsule.radius} * x, centre.y + double{capsule.radius} * y});
      });
    }
  }
  void add(const ConvexHull& hull) {
    for (const Vec3f& point : hull.points) add(point);
  }
  void add(const TriangleMesh& mesh) {
    for (const Vec3f& vertex : mesh.vertices) add(vertex);
  }
  void add(const SupportShape& shape) {
    for_each_direction([&](double x, double y) {
      add(shape.function->support(to_float(rotate_inverse(rotation_, {x, y, 0}))));
    });
  }

  Outline outline() && {
    Outline outline;
    outline.corners = convex_hull(std::move(points_));
    for (const Point& corner : outline.corners)
      outline.radius = std::max(outline.radius, std::hypot(corner.x, corner.y));
    return outline;
  }

 private:
  template <class Visit>
  static void for_each_direction(Visit visit) {
    for (int side = 0; side < sides_of_circle; ++side) {
      const double angle = 2 * std::numbers::pi * side / sides_of_circle;
      visit(std::cos(angle), std::sin(angle));
    }
  }

  RotationD rotation_;
  std::vector<Point> points_;
};

}  // namespace

std::vector<Point> convex_hull(std::vector<Point> points) {
  std::sort(points.begin(), points.end(),
            [](const Point& p, const Point& q) { return p.x != q.x ? p.x < q.x : p.y < q.y; });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  std::vector<Point> hull;
  const auto add_chain = [&hull](auto first, auto last) {
    const std::size_t start = hull.size();
    for (; first != last; ++first) {
      while (hull.size() >= start + 2) {
        const Point &p = hull[hull.size() - 2], &q = hull.back();
        if ((q.x - p.x) * (first->y - p.y) - (q.y - p.y) * (first->x - p.x) > 0) break;
        hull.pop_back();
      }
      hull.push_back(*first);
    }
    hull.pop_back();
  };
  add_chain(points.begin(), points.end());
  add_chain(points.rbegin(), points.rend());
  return hull;
}

Outline outline_of(const ShapeDescription& shape, Quat orientation) {
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return {{}, double{sphere->radius}};
  Projection projection(orientation);
  try {
    std::visit(
        [&](const auto& each) {
          if constexpr (!std::is_same_v<std::decay_t<decltype(each)>, Sphere>) projection.add(each);
        },
        shape);
  } catch (...) {  // a support function of an embedder may throw anything
    return {};
  }
  return std::move(projection).outline();
}

}  // namespace ringfence::tools
