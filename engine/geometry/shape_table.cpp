#include "geometry/shape_table.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <string>

#include "geometry/solid_bounds.hpp"
#include "geometry/vector.hpp"
#include "ringfence/error.hpp"

namespace ringfence::geometry {
namespace {

constexpr double min_thickness = 1e-3;
constexpr double max_coordinate = 1e6;
constexpr double pi = 3.14159265358979323846;
constexpr float ball_of_removed = 0.5e-3f;  // radius of what stands for a removed shape

std::string to_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

void check_size(const char* what, double value, double lowest) {
  if (std::isnan(value) || value < lowest || value > max_coordinate) {
    throw Error(std::string(what) + " is " + to_text(value) + " m; expected " + to_text(lowest) + " to " +
                to_text(max_coordinate));
  }
}

void check_coordinate(const char* what, std::size_t index, Vec3f point) {
  for (const float value : {point.x, point.y, point.z}) {
    if (std::isnan(value) || std::abs(value) > static_cast<float>(max_coordinate)) {
      throw Error(std::string(what) + " " + std::to_string(index) + " has the coordinate " + to_text(double{value}) +
                  " m; expected at most " + to_text(max_coordinate));
    }
  }
}

ShapeRow row_of(const Sphere& sphere) {
  check_size("sphere radius", double{sphere.radius}, min_thickness / 2);
  return {.size = {sphere.radius, 0, 0}, .bounding_radius = sphere.radius, .kind = ShapeKind::sphere};
}

ShapeRow row_of(const Box& box) {
  const Vec3f h = box.half_extents;
  check_size("box half extent x", double{h.x}, min_thickness / 2);
  check_size("box half extent y", double{h.y}, min_thickness / 2);
  check_size("box half extent z", double{h.z}, min_thickness / 2);
  return {.size = {h.x, h.y, h.z}, .bounding_radius = rounded_up(length(to_double(h))), .kind = ShapeKind::box};
}

ShapeRow row_of(const Capsule& capsule) {
  check_size("capsule radius", double{capsule.radius}, min_thickness / 2);
  check_size("capsule half height", double{capsule.half_height}, 0.0);
  return {.size = {capsule.radius, capsule.half_height, 0},
          .bounding_radius = rounded_up(double{capsule.radius} + double{capsule.half_height}),
          .kind = ShapeKind::capsule};
}

/// Computes the row of a support function. Its bounding ball is the one around the origin that contains the function's
/// box on the shape's axes.
ShapeRow row_of(const SupportFunction& f) {
  const Vec3f high{f.support({1, 0, 0}).x, f.support({0, 1, 0}).y, f.support({0, 0, 1}).z};
  const Vec3f low{f.support({-1, 0, 0}).x, f.support({0, -1, 0}).y, f.support({0, 0, -1}).z};
  check_coordinate("support point", 0, high);
  check_coordinate("support point", 1, low);
  const Vec3d size = to_double(high) - to_double(low);
  if (std::min({size.x, size.y, size.z}) < min_thickness) {
    throw Error("support shape: thinner than 1 mm, or support() does not return the farthest point");
  }
  const Vec3f centre = f.centre();
  if (!is_finite(centre) || !(centre.x > low.x && centre.x < high.x && centre.y > low.y && centre.y < high.y &&
                              centre.z > low.z && centre.z < high.z)) {
    throw Error("support shape: centre() is not inside");
  }
  const auto corner = [](float p, float q) { return std::max(std::abs(double{p}), std::abs(double{q})); };
  return {
      .bounding_radius = rounded_up(length(Vec3d{corner(low.x, high.x), corner(low.y, high.y), corner(low.z, high.z)})),
      .kind = ShapeKind::support};
}

ShapeRow row_of(const SupportShape& shape) {
  if (!shape.function) throw Error("support shape: no function");
  try {
    return row_of(*shape.function);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(std::string("support shape: its function threw: ") + error.what());
  } catch (...) {
    throw Error("support shape: its function threw an exception that is no std::exception");
  }
}

struct Extent {
  Vec3d lower, upper;  ///< relative to the position, on the world's axes
};

Extent support_extent(const CheckedSupport& function, const Rotation& r) {
  const auto support_along = [&](const float row[3], float sign) {
    const Vec3f direction{row[0] * sign, row[1] * sign, row[2] * sign};
    return double{dot(direction, function.support(direction)) * sign};
  };
  return {{support_along(r.m[0], -1), support_along(r.m[1], -1), support_along(r.m[2], -1)},
          {support_along(r.m[0], 1), support_along(r.m[1], 1), support_along(r.m[2], 1)}};
}

Extent ball_extent(double radius) { return {{-radius, -radius, -radius}, {radius, radius, radius}}; }

}  // namespace

ShapeTable::ShapeTable() = default;
ShapeTable::~ShapeTable() = default;

ShapeNumber ShapeTable::add(const ShapeDescription& description) {
  ShapeRow row;
  if (const auto* sphere = std::get_if<Sphere>(&description)) {
    row = row_of(*sphere);
  } else if (const auto* box = std::get_if<Box>(&description)) {
    row = row_of(*box);
  } else if (const auto* capsule = std::get_if<Capsule>(&description)) {
    row = row_of(*capsule);
  } else if (const auto* points = std::get_if<ConvexHull>(&description)) {
    for (std::size_t i = 0; i < points->points.size(); ++i) check_coordinate("hull point", i, points->points[i]);
    Hull hull = build_hull(points->points);
    check_size("hull bounding radius", double{hull.bounding_radius()}, min_thickness / 2);
    const Vec3f centre = hull.centroid();
    row = {.size = {centre.x, centre.y, centre.z},
           .bounding_radius = hull.bounding_radius(),
           .kind = ShapeKind::hull,
           .index_in_kind = static_cast<std::uint32_t>(hulls_.size())};
    owned_hulls_.push_back(std::make_unique<const Hull>(std::move(hull)));
    hulls_.push_back(owned_hulls_.back().get());
  } else if (const auto* triangles = std::get_if<TriangleMesh>(&description)) {
    for (std::size_t i = 0; i < triangles->vertices.size(); ++i) {
      check_coordinate("mesh vertex", i, triangles->vertices[i]);
    }
    auto mesh = std::make_unique<const Mesh>(*triangles);
    check_size("mesh bounding radius", double{mesh->bounding_radius()}, min_thickness / 2);
    row = {.bounding_radius = mesh->bounding_radius(),
           .kind = ShapeKind::mesh,
           .index_in_kind = static_cast<std::uint32_t>(meshes_.size())};
    owned_meshes_.push_back(std::move(mesh));
    meshes_.push_back(owned_meshes_.back().get());
  } else {
    const SupportShape& shape = std::get<SupportShape>(description);
    row = row_of(shape);
    row.index_in_kind = static_cast<std::uint32_t>(supports_.size());
    owned_supports_.push_back(
        std::make_unique<CheckedSupport>(shape.function, static_cast<ShapeNumber>(rows_.size()), row.bounding_radius));
    supports_.push_back(owned_supports_.back().get());
  }
  descriptions_.push_back(description);
  removed_.push_back(false);
  hull_of_.push_back(row.kind == ShapeKind::hull ? owned_hulls_.back().get() : nullptr);
  rows_.push_back(row);
  return static_cast<ShapeNumber>(rows_.size() - 1);
}

void ShapeTable::remove(ShapeNumber shape, std::uint64_t time) {
  to_be_freed_.push_back({shape, time});
  removed_[shape] = true;
  descriptions_[shape] = Sphere{ball_of_removed};
}

void ShapeTable::free_removed(std::uint64_t latest) {
  const auto kept = std::find_if(to_be_freed_.begin(), to_be_freed_.end(),
                                 [&](const Removed& removed) { return removed.time > latest; });
  for (auto removed = to_be_freed_.begin(); removed != kept; ++removed) {
    const ShapeNumber shape = removed->shape;
    const ShapeRow row = rows_[shape];
    rows_.replace(shape, row_of(Sphere{ball_of_removed}));
    hull_of_.replace(shape, nullptr);
    if (row.kind == ShapeKind::hull) owned_hulls_[row.index_in_kind].reset();
    if (row.kind == ShapeKind::mesh) owned_meshes_[row.index_in_kind].reset();
    if (row.kind == ShapeKind::support) owned_supports_[row.index_in_kind].reset();
  }
  to_be_freed_.erase(to_be_freed_.begin(), kept);
}

std::vector<std::string> ShapeTable::take_support_failures() const {
  std::vector<std::string> out;
  for (const auto& support : owned_supports_) {
    if (support == nullptr) continue;
    if (auto failure = support->take_first_failure()) out.push_back(std::move(*failure));
  }
  return out;
}

double ShapeTable::volume(ShapeNumber shape) const noexcept {
  const ShapeRow& row = rows_[shape];
  const double a = row.size[0], b = row.size[1], c = row.size[2];
  switch (row.kind) {
    case ShapeKind::sphere:
      return 4.0 / 3.0 * pi * a * a * a;
    case ShapeKind::box:
      return 8 * a * b * c;
    case ShapeKind::capsule:
      return pi * a * a * (4.0 / 3.0 * a + 2 * b);
    case ShapeKind::hull:
      return hulls_[row.index_in_kind]->volume();
    case ShapeKind::mesh:
    case ShapeKind::support:
      break;
  }
  return 0;
}

Bounds ShapeTable::bounds(ShapeNumber shape, const Pose& pose, const FixedSpace& space) const noexcept {
  const PlacedShape placed{&pose, shape};
  Bounds out;
  bounds({&placed, 1}, space, &out);
  return out;
}

void ShapeTable::bounds(std::span<const PlacedShape> placed, const FixedSpace& space, Bounds* out,
                        FixedPoint* points) const noexcept {
  compute_solid_bounds(placed, rows_.data(), hull_of_.data(), space, out, points);
  if (meshes_.empty() && supports_.empty()) return;
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const ShapeRow& row = rows_[placed[i].shape];
    if (row.kind > ShapeKind::hull) out[i] = slow_bounds(row, *placed[i].pose, space);
  }
}

/// The bounds of a mesh or a support shape.
Bounds ShapeTable::slow_bounds(const ShapeRow& row, const Pose& pose, const FixedSpace& space) const noexcept {
  const Rotation r = rotation(pose.orientation);
  Extent extent;
  if (row.kind == ShapeKind::mesh) {
    meshes_[row.index_in_kind]->extent(r, extent.lower, extent.upper);
  } else {
    try {
      extent = support_extent(*supports_[row.index_in_kind], r);
    } catch (const SupportFailure&) {
      extent = ball_extent(double{row.bounding_radius});
    }
  }
  const double margin = rounding_margin * double{row.bounding_radius};
  const Vec3d widening{margin, margin, margin};
  return space.bounds(pose.position + (extent.lower - widening), pose.position + (extent.upper + widening));
}

}  // namespace ringfence::geometry
