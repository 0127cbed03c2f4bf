#include "nodes/server/server_state.hpp"

#include <algorithm>
#include <utility>

namespace ringfence::nodes {

using messages::Endpoint;

ServerState::ServerState(const ServerSetup& initial, const regions::RegionMap& first_map)
    : setup(initial),
      map(first_map),
      objects(setup.capacities.objects, setup.model == nullptr ? 0 : (setup.model->state_bytes() + 7) / 8 * 8),
      host(setup.model, setup.deployment == Deployment::user_server ? setup.capacities.objects : 0),
      ledger(setup.nodes.size(), setup.capacities.contacts, setup.deepest_contacts, setup.contact_frames),
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
  leaving.reserve(setup.capacities.objects);
  hand_overs.reserve(setup.capacities.objects);
}

void ServerState::list_shared_nodes() {
  shared_nodes.resize(nodes.size());
  for (std::size_t slot = 0; slot < nodes.size(); ++slot) {
    shared_nodes[slot] = nodes[slot].is_active() ? nodes[slot].connection.node_contacts : nullptr;
  }
}

void ServerState::list_remaining_nodes(std::vector<NodeNumber>& remaining) const {
  remaining.clear();
  for (const bool leaves : {false, true}) {
    for (const PeerSession& session : nodes) {
      if (session.is_active() && session.leaving == leaves) {
        remaining.push_back(session.self.number());
      }
    }
    if (!remaining.empty()) {
      break;
    }
  }
}

void ServerState::connect(UserNumber user, const Connection& connection) {
  if (user >= users.size()) {
    users.resize(user + 1);
  }
  PeerSession& session = users[user];
  session = {};
  session.self = Endpoint::user(user);
  session.connection = connection;
  session.connected = true;
  const auto insert = [user](std::vector<UserNumber>& list) {
    list.insert(std::lower_bound(list.begin(), list.end(), user), user);
  };
  insert(connected);
  const auto same = [&](const UserConnection& peers) { return peers.connection.in == connection.in; };
  auto peers = std::find_if(user_connections.begin(), user_connections.end(), same);
  if (peers == user_connections.end()) {
    peers = user_connections.emplace(peers);
    peers->connection = connection;
  }
  insert(peers->users);
  session.user_connection = static_cast<std::uint32_t>(peers - user_connections.begin());
}

void ServerState::remove_disconnected() {
  const auto has_left = [this](UserNumber user) { return !users[user].connected; };
  std::erase_if(connected, has_left);
  std::erase_if(refused_users, has_left);
  for (UserConnection& peers : user_connections) {
    std::erase_if(peers.users, has_left);
    std::erase_if(peers.changed, has_left);
    std::erase_if(peers.notified, has_left);
  }
  std::erase_if(user_connections, [](const UserConnection& peers) { return peers.users.empty(); });
  for (std::uint32_t at = 0; at < user_connections.size(); ++at) {
    for (const UserNumber user : user_connections[at].users) {
      users[user].user_connection = at;
    }
  }
}

void ServerState::note_host_change(std::uint32_t slot) {
  objects.marks(slot) |= host_changed_mark;
  host_changes.push_back(slot);
}

PeerSession::Opening* ServerState::opening_of(Endpoint peer) {
  PeerSession* const session = session_of(peer);
  if (session == nullptr) {
    return nullptr;
  }
  if (!std::exchange(session->changes, true) && peer.is_user()) {
    user_connections[session->user_connection].changed.push_back(peer.number());
  }
  return &session->opening;
}

}  // namespace ringfence::nodes
