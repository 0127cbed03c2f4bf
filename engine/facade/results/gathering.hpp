#pragma once

#include "facade/cd_nodes/cd_nodes.hpp"
#include "facade/users/user_nodes.hpp"
#include "facade/world_state.hpp"
#include "nodes/server/server_role.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence::facade {

// What the report of a frame has from several roles. Called by the thread that calls World when the frame is complete:
// the roles wait then. Those whose threads may still run, because they are lost or late, are left out.

/// Sets FrameReport::model_failures: of all roles, and of remote nodes.
void gather_model_failures(FrameReport& report, const WorldState& state, const nodes::ServerRole& server,
                           const CdNodes& nodes, const UserNodes& users);

/// Sets FrameReport::timeline, and clears the tracks. Empty unless WorldConfig::timeline is set.
void gather_timeline(FrameReport& report, WorldState& state, const CdNodes& nodes, const UserNodes& users);

}  // namespace ringfence::facade
