#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "motion/steering.hpp"
#include "ringfence/motion_model.hpp"
#include "worlds/motion_file.hpp"

namespace ringfence::tools {

/// What moves a world's objects, as bytes: a node in another process makes the same motion model of them.
std::vector<std::byte> pack_motion(const motion::SteeringConfig& steering);
std::vector<std::byte> pack_motion(const worlds::Motion& motion);

/// The model that the bytes describe. Throws Error where they are from another version of the program.
std::shared_ptr<const MotionModel> unpack_motion(std::span<const std::byte> bytes);

}  // namespace ringfence::tools
