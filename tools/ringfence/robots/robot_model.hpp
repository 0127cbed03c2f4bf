#pragma once

#include <optional>

#include "gateway/client/obstacles.hpp"
#include "gateway/protocol/server_messages.hpp"
#include "motion/walk.hpp"

namespace ringfence::tools {

/// What the robots of a process need to predict their avatars: the model of the world, and the shapes in it.
class RobotModel {
 public:
  RobotModel();
  /// Reads the model from the first welcome. Throws Error if it is not `walk`.
  void begin(const gateway::Welcome& welcome);
  /// Precondition: begin() was called.
  const motion::Walk& walk() const { return *walk_; }
  gateway::Obstacles& obstacles() noexcept { return obstacles_; }

 private:
  std::optional<motion::Walk> walk_;
  gateway::Obstacles obstacles_;
};

}  // namespace ringfence::tools
