#pragma once

#include <cstdint>
#include <memory>

#include "facade/recorded_world.hpp"
#include "ringfence/config.hpp"

namespace ringfence::bench {

/// The service itself, in user/collision deployment without users: the CD nodes move the objects, by a motion model
/// that looks the recorded pose up.
std::unique_ptr<FrameTester> make_service_frame(const RecordedWorld& world, std::uint32_t nodes, Placement placement);

/// The service with nodes = 0 and without a motion model: every object is put where it is by World::place, each frame.
std::unique_ptr<FrameTester> make_place_frame(const RecordedWorld& world);

}  // namespace ringfence::bench
