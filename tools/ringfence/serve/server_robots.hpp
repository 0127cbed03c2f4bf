#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ringfence/world.hpp"
#include "serve/spawn_places.hpp"

namespace ringfence::tools {

/// Avatars that the server moves itself, to fill a world. They are users of the World without a connection; their
/// numbers are the highest ones.
class ServerRobots {
 public:
  ServerRobots(World& world, SpawnPlaces& places) : world_(world), places_(places) {}

  /// Changes their number; returns a sentence about the outcome.
  std::string resize(std::uint32_t count);
  /// Chooses what each does in the next frame.
  void before_frame();
  std::size_t size() const noexcept { return robots_.size(); }

 private:
  struct Robot {
    UserId user;
    ObjectId avatar;
  };
  bool add();

  World& world_;
  SpawnPlaces& places_;
  std::vector<Robot> robots_;
};

}  // namespace ringfence::tools
