#pragma once

#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Chooses where avatars appear: on a spiral around the middle of the world, so that the first players meet, and many
/// spread over it. Places where the avatar would touch something are left out, if there are others.
class SpawnPlaces {
 public:
  /// `shape`: of avatars. `height`: of their positions above the lower bound of z, metres.
  SpawnPlaces(World& world, ShapeId shape, double height) : world_(world), shape_(shape), height_(height) {}

  /// Spawns an avatar of the user; a null id if the world refuses.
  ObjectId spawn(UserId user);

 private:
  Vec3d place(std::uint32_t index) const;
  bool is_free(const Snapshot& snapshot, const Vec3d& place) const;

  World& world_;
  ShapeId shape_;
  double height_;
  std::uint32_t next_ = 0;  ///< index of the next place on the spiral
};

}  // namespace ringfence::tools
