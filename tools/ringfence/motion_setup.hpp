#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "motion/steering.hpp"
#include "ringfence/motion_model.hpp"
#include "worlds/motion_file.hpp"

namespace ringfence::tools {

/// Serializes the parameters of a motion model, so that a node in another process can create the same model.
std::vector<std::byte> pack_motion(const motion::SteeringConfig& steering);
std::vector<std::byte> pack_motion(const worlds::Motion& motion);

/// Creates the motion model from serialized parameters. Throws Error if their layout is not that of this program.
std::shared_ptr<const MotionModel> unpack_motion(std::span<const std::byte> bytes);

}  // namespace ringfence::tools
