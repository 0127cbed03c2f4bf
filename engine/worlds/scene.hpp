#pragma once

#include <string>
#include <vector>

#include "ringfence/config.hpp"
#include "ringfence/object.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::worlds {

/// A shape and the name by which the objects of a scene file refer to it.
struct NamedShape {
  std::string name;
  ShapeDescription description;
  std::string mesh_file;  ///< meshes only: path as written in the scene file, relative to its folder
};

/// The initial state of a world: generated, read from a file, or recorded. Bounds are in metres.
///
/// Invariants: `ObjectSpec::shape` is an index into `shapes`; object numbers are distinct and not 0; avatars, and only
/// avatars, have a user.
struct Scene {
  Vec3d bounds_min{0, 0, 0};
  Vec3d bounds_max{100, 100, 100};
  std::string contact_label;  ///< what a contact means in this world, for reports ("loss of separation"); often empty
  LayerMatrix layers;         ///< without names: one layer, in which all objects collide
  std::vector<NamedShape> shapes;
  std::vector<ObjectSpec> objects;
};

/// Number of user nodes that the avatars of the scene need: the highest user number plus 1, or 0 without avatars.
std::uint32_t users_of(const Scene& scene);

}  // namespace ringfence::worlds
