#pragma once

#include <string>
#include <vector>

#include "ringfence/config.hpp"
#include "ringfence/object.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::worlds {

/// A shape of a scene under the name that objects use for it.
struct NamedShape {
  std::string name;
  ShapeDescription description;
  std::string mesh_file;  ///< meshes only: as written in the scene file, relative to it
};

/// A world before its first frame: plain data, whether generated, read or recorded.
///
/// `ObjectSpec::shape` is an index into `shapes`; numbers are distinct and never 0; avatars have a user, others none.
struct Scene {
  Vec3d bounds_min{0, 0, 0};
  Vec3d bounds_max{100, 100, 100};
  LayerMatrix layers;  ///< without names: one layer, all collide
  std::vector<NamedShape> shapes;
  std::vector<ObjectSpec> objects;
};

/// How many user nodes the scene's avatars need: the highest user number and one.
UserNumber users_of(const Scene& scene);

}  // namespace ringfence::worlds
