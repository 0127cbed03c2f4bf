#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "nodes/server/server_role.hpp"
#include "ringfence/world.hpp"

namespace ringfence::facade {

// Objects as the server has them after the last frame. Called by the thread that calls World, while no frame is
// running.

/// The slot of an object in the server's table, or base::NumberIndex::none.
std::uint32_t slot_of(const nodes::ServerRole& server, ObjectId object) noexcept;
/// The object in a slot. Precondition: it is alive.
ObjectView view_of(const nodes::ServerRole& server, std::uint32_t slot);
/// All objects, ascending by number. Allocates.
std::vector<ObjectView> views_of(const nodes::ServerRole& server);

}  // namespace ringfence::facade
