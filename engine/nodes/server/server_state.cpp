#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

using messages::Endpoint;

ServerState::ServerState(const ServerSetup& initial, const regions::RegionMap& first_map)
    : setup(initial),
      map(first_map),
      objects(setup.capacities.objects, setup.model == nullptr ? 0 : (setup.model->state_bytes() + 7) / 8 * 8),
      host(setup.model, setup.deployment == Deployment::user_server ? setup.capacities.objects : 0),
      ledger(setup.nodes.size(), setup.capacities.contacts, setup.deepest_contacts),
      nodes(setup.nodes.size()) {
  host.sense(setup.sense);
  for (NodeNumber node = 0; node < nodes.size(); ++node) {
    PeerSession& session = nodes[node];
    session.self = Endpoint::node(node);
    session.id = node;
    session.connection = setup.nodes[node];
    session.connected = true;
  }
  users.reserve(setup.capacities.users);
  connected.reserve(setup.capacities.users);
  awaited_users.reserve(setup.capacities.users);
  leaving_slots.reserve(setup.capacities.objects);
  hand_overs.reserve(setup.capacities.objects);
}

void ServerState::list_remaining_nodes(std::vector<NodeNumber>& remaining) const {
  remaining.clear();
  for (const bool leaving : {false, true}) {
    for (const PeerSession& session : nodes) {
      if (session.is_active() && session.leaving == leaving) {
        remaining.push_back(session.self.number());
      }
    }
    if (!remaining.empty()) {
      break;
    }
  }
}

void ServerState::note_host_change(std::uint32_t slot) {
  objects.marks(slot) |= host_changed_mark;
  host_changes.push_back(slot);
}

}  // namespace ringfence::nodes
