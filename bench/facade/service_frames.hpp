#pragma once

#include <cstdint>
#include <memory>

#include "facade/recorded_world.hpp"
#include "ringfence/config.hpp"

namespace ringfence::bench {

/// The service in the user/collision deployment without users: the CD nodes move the objects by a motion model that
/// looks up the recorded pose.
std::unique_ptr<FrameTester> make_service_frame(const RecordedWorld& world, std::uint32_t nodes, Placement placement);

/// The service with nodes = 0 and without a motion model: World::place sets the pose of every object in each frame.
std::unique_ptr<FrameTester> make_place_frame(const RecordedWorld& world);

}  // namespace ringfence::bench
