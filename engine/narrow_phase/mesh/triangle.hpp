#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "geometry/mesh_tree.hpp"
#include "geometry/vector.hpp"

/// The contacts of one triangle, exact in double: what the walks through mesh trees judge by. Everything is in the axes
/// of the mesh that the triangle belongs to.
namespace ringfence::narrow_phase {

struct Triangle {
  Vec3d corner[3];
};

/// The triangle in a lane of a leaf.
Triangle triangle_of(const geometry::TriangleGroup& leaf, std::size_t lane) noexcept;

/// The least translation of the other shape that takes it off a triangle.
struct Penetration {
  double depth = none;  ///< metres; below zero where the two are apart
  Vec3d normal;         ///< unit, from the triangle to the other shape

  /// Surely less than was asked for: nothing else of the push means anything.
  static constexpr double none = -1e300;
};

// In each, `at_least` >= 0 is the depth that is of interest: as soon as the depth is proven to be less, Push::none is
// answered. Otherwise the answer does not depend on it. No direction is left out that could be the one of least depth:
// the normals of the faces of the Minkowski difference, which of flat shapes includes those within their planes.

Penetration ball_penetration(const Triangle& triangle, Vec3d centre, double radius, double at_least) noexcept;

/// The points within `radius` of a segment.
Penetration capsule_penetration(const Triangle& triangle, const Vec3d ends[2], double radius, double at_least) noexcept;

/// `turn` takes the box's axes to the mesh's.
Penetration box_penetration(const Triangle& triangle, Vec3d centre, const geometry::RotationD& turn,
                            const double half[3], double at_least) noexcept;

Penetration triangle_penetration(const Triangle& triangle, const Triangle& other, double at_least) noexcept;

/// The place midway between the two surfaces where they overlap by the push. `points` are those of the other shape (of
/// its core, if it has a `radius`), all or at least those lowest along the normal; those that lie within `slack` of the
/// lowest or the highest belong to the feature that meets.
Vec3d contact_point_of(const Penetration& penetration, const Triangle& triangle, std::span<const Vec3d> points,
                       double radius, double slack) noexcept;

/// The slack for contact_point_of: what a place may be off, and what rounding the normals of hulls to float makes the
/// corners of one face differ in height. `small` is the smaller bounding radius, `both` the sum of the two.
constexpr double feature_slack(double small, double both) noexcept { return 1e-5 * small + 3e-7 * both; }

}  // namespace ringfence::narrow_phase
