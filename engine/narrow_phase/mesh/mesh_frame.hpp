#pragma once

#include <cstdint>

#include "geometry/vector.hpp"
#include "narrow_phase/mesh/triangle.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::narrow_phase {

/// Another body in the axes of a mesh. Meshes are tested in their own axes, in double where it decides the result.
struct MeshFrame {
  geometry::RotationD mesh_rotation;  ///< from the mesh's axes to the world's
  geometry::RotationD rotation;       ///< from the other body's axes to the mesh's
  Vec3d position;                     ///< of the other body, in the mesh's axes and relative to its origin

  MeshFrame(const Pose& mesh, const Pose& other) noexcept
      : mesh_rotation(geometry::rotation_exact(mesh.orientation)),
        position(geometry::rotate_inverse(mesh_rotation, other.position - mesh.position)) {
    const geometry::RotationD own = geometry::rotation_exact(other.orientation);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        rotation.m[i][j] = (mesh_rotation.m[0][i] * own.m[0][j] + mesh_rotation.m[1][i] * own.m[1][j]) +
                           mesh_rotation.m[2][i] * own.m[2][j];
      }
    }
  }

  Vec3d to_mesh(Vec3d p) const noexcept { return position + geometry::rotate(rotation, p); }

  /// The contact for a penetration and a contact point, both in the mesh's axes.
  PairContact contact(std::uint32_t pair, const Penetration& penetration, Vec3d point, bool mesh_is_a) const noexcept {
    const Vec3f n = to_float(geometry::rotate(mesh_rotation, mesh_is_a ? penetration.normal : -penetration.normal));
    const Vec3f p = to_float(geometry::rotate(mesh_rotation, mesh_is_a ? point : point - position));
    // Adding zero makes every zero positive, so that its sign does not depend on the computation.
    return {pair,
            static_cast<float>(penetration.depth) + 0.0f,
            {n.x + 0.0f, n.y + 0.0f, n.z + 0.0f},
            {p.x + 0.0f, p.y + 0.0f, p.z + 0.0f}};
  }
};

}  // namespace ringfence::narrow_phase
