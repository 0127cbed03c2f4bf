#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "geometry/mesh_tree.hpp"
#include "geometry/vector.hpp"

/// The exact penetration of one triangle, in double, with which the walks through mesh trees evaluate primitives.
/// Everything is in the axes of the triangle's mesh.
namespace ringfence::narrow_phase {

struct Triangle {
  Vec3d corner[3];
};

/// The triangle in one lane of a leaf.
Triangle triangle_of(const geometry::TriangleGroup& leaf, std::size_t lane) noexcept;

/// The least translation of the other shape that separates it from a triangle.
struct Penetration {
  double depth = none;  ///< metres; negative if the two are apart
  Vec3d normal;         ///< unit, from the triangle to the other shape

  /// The depth is certainly less than required; the other fields are meaningless.
  static constexpr double none = -1e300;
};

// The functions below take the least depth of interest, `at_least` >= 0. As soon as the depth is proven to be less,
// they return Penetration::none; otherwise the result does not depend on it. They try every direction that can have the
// least depth: the normals of the faces of the Minkowski difference, which for flat shapes includes normals in their
// plane.

Penetration ball_penetration(const Triangle& triangle, Vec3d centre, double radius, double at_least) noexcept;

/// A capsule: the points within `radius` of a segment.
Penetration capsule_penetration(const Triangle& triangle, const Vec3d ends[2], double radius, double at_least) noexcept;

/// `rotation` is the rotation from the box's axes to the mesh's.
Penetration box_penetration(const Triangle& triangle, Vec3d centre, const geometry::RotationD& rotation,
                            const double half[3], double at_least) noexcept;

Penetration triangle_penetration(const Triangle& triangle, const Triangle& other, double at_least) noexcept;

/// The point midway between the two surfaces where they overlap by the penetration. `points` are those of the other
/// shape (of its core, if it has a `radius`), all of them or at least those lowest along the normal. Points within
/// `slack` of the lowest or highest one belong to the touching feature; where these features lie beside each other,
/// points within more.
Vec3d contact_point_of(const Penetration& penetration, const Triangle& triangle, std::span<const Vec3d> points,
                       double radius, double slack) noexcept;

/// The slack for contact_point_of: the permitted error of a contact point, plus the difference in height of the corners
/// of one face that results from rounding normals to float. `small` is the smaller bounding radius, `both` the sum of
/// the two.
constexpr double feature_slack(double small, double both) noexcept { return 1e-5 * small + 3e-7 * both; }

}  // namespace ringfence::narrow_phase
