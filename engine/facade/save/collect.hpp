#pragma once

#include <cstddef>
#include <span>

#include "facade/requests/requests.hpp"
#include "facade/save/saved_world.hpp"
#include "facade/world_state.hpp"
#include "nodes/server/server_role.hpp"

namespace ringfence::facade {

/// What determines the future of a World after `frames` complete frames. Call between frames. Shapes are referred to,
/// not copied: valid until one is removed.
SavedWorld collect(const WorldState& state, const Requests& requests, const nodes::ServerRole& server,
                   std::uint64_t frames, std::span<const std::byte> own);

/// Whether every support function has a name, so that a save can refer to it.
bool can_be_saved(const geometry::ShapeTable& shapes) noexcept;

}  // namespace ringfence::facade
