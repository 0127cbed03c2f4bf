#pragma once

#include "facade/requests/requests.hpp"
#include "facade/save/saved_world.hpp"
#include "ringfence/config.hpp"

namespace ringfence::nodes {
class ServerRole;
}

namespace ringfence::facade {

/// The configuration of the World that `saved` continues in: with the saved layers, if `config` has none, and with
/// bounds around the objects, if `config` leaves the bounds to the World. Throws Error if the configuration does not
/// fit the save.
WorldConfig config_for(WorldConfig config, const SavedWorld& saved);

/// Restores ids, users and pending requests in `requests`, which no call has used. Throws Error if they do not fit
/// together.
void restore_requests(const SavedWorld& saved, Requests& requests);

/// Restores objects and contacts in the server, before its first frame. All shapes are registered.
void restore_objects(const SavedWorld& saved, nodes::ServerRole& server);

}  // namespace ringfence::facade
