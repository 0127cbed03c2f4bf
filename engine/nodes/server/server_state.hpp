#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "link/wake_tree.hpp"
#include "messages/run.hpp"
#include "nodes/host/host.hpp"
#include "nodes/server/contacts/contact_ledger.hpp"
#include "nodes/server/objects/object_table.hpp"
#include "nodes/server/peer_session.hpp"
#include "nodes/server/server_setup.hpp"
#include "nodes/server/user_connection.hpp"
#include "regions/region_map.hpp"
#include "ringfence/frame_report.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

/// The stages of a frame, in order; see ServerRole.
enum class FrameStage : std::uint8_t {
  waiting,
  starting_nodes,
  starting_users,
  moving,
  dispatching,
  colliding,
  notifying,
  notifying_users,
  closing
};

/// Which objects Dispatch sends.
enum class UpdateScope : std::uint8_t {
  changes,      ///< objects that moved, unless their host keeps the others up to date
  not_hosted,   ///< these, and all present objects that no node hosts: the map has changed, and hosts send the rest
  all_objects,  ///< all present objects: the map has changed
};

/// What a new region map requires in the frame.
struct MapChange {
  bool at_end = false;          ///< nodes receive a new map at the end of this frame
  bool precedes_frame = false;  ///< nodes receive the map before this frame begins
  bool rescan_hosts = false;    ///< the map changed within this frame or before it: every object may change its host
  /// Nodes send each other what they host under the map that begins with the next frame.
  bool hosts_exchange_objects = false;
  /// Of this frame; more than `changes` after a change of the map.
  UpdateScope updates = UpdateScope::changes;
};

/// An object that another CD node hosts from the next frame on.
struct HandOver {
  std::uint32_t slot;
  NodeNumber from, to;
};

/// The data that the parts of the server share. Each part changes it in its own steps of the frame; `stage` says where
/// the frame is, and ServerRole and Failover change it.
///
/// Threads: belongs to the server role. Parts hold a reference, so it must not move.
struct ServerState {
  /// The id of each node of the setup is its slot.
  ServerState(const ServerSetup& initial, const regions::RegionMap& first_map);
  ServerState(const ServerState&) = delete;
  ServerState& operator=(const ServerState&) = delete;

  const ServerSetup setup;
  regions::RegionMap map;
  MapChange map_change;
  ObjectTable objects;
  Host host;  ///< objects that the server hosts
  ContactLedger ledger;
  std::vector<PeerSession> nodes;  ///< by slot; a free slot is not connected
  /// By slot: what the active CD nodes of this process share; null if the slot has none. From the cut on.
  std::vector<NodeContacts*> shared_nodes;
  std::vector<PeerSession> users;     ///< by user number
  std::vector<UserNumber> connected;  ///< users, ascending
  std::vector<UserConnection> user_connections;
  std::size_t lost_users = 0;             ///< number of connected users that are lost
  std::size_t awaited_users = 0;          ///< number of those from which the frame still needs states
  std::vector<UserNumber> refused_users;  ///< those with refused records in this frame
  std::size_t state_senders = 0;          ///< CD nodes that have sent states (`node_state`) in this frame
  std::vector<NextHostOf> leaving;        ///< objects that leave their hosts, as these have reported in this frame
  std::vector<HandOver> hand_overs;       ///< of this frame
  /// Slots of nodes that were lost in the frame before when the contacts were final: other nodes may not have received
  /// the contacts that these found.
  std::vector<NodeNumber> lost_finders;
  /// Objects whose hosts do not have their contacts of the last frame: with host_changed_mark.
  std::vector<std::uint32_t> host_changes;
  FrameStage stage = FrameStage::waiting;
  std::uint64_t frame = 0;
  std::uint64_t begin_ns = 0;     ///< start of the frame
  std::uint64_t dispatch_ns = 0;  ///< start of the dispatch of positions and pairs
  std::uint64_t notify_ns = 0;    ///< start of the notification of hosts
  FrameReport reports[2];         ///< by parity of the frame
  ModelFailures model_failures;   ///< of the frame, for objects that were spawned or that the server moved
  /// Wakes the threads of all CD nodes; null if there are few of them, or not each node has a thread.
  std::shared_ptr<link::WakeTree> wake_tree;
  FrameStage woken_stage = FrameStage::waiting;  ///< the last one that has woken them
  double rings_ms = 0;                           ///< CPU time of the server's rings in it

  // Both call `done` for every connected peer of a kind that is not lost, also after one has returned false. They
  // return whether all returned true.
  template <class Done>
  bool all_nodes(Done done) {
    bool all = true;
    for (PeerSession& session : nodes) {
      all &= !session.is_active() || done(session);
    }
    return all;
  }
  /// The same; calls prefetch(session) for each a few sessions ahead, because those of many nodes are in no cache of
  /// this core.
  template <class Prefetch, class Done>
  bool all_nodes(Prefetch prefetch, Done done) {
    constexpr std::size_t ahead = 6;
    bool all = true;
    for (std::size_t slot = 0; slot < nodes.size() + ahead; ++slot) {
      if (slot < nodes.size()) {
        prefetch(nodes[slot]);
      }
      all &= slot < ahead || !nodes[slot - ahead].is_active() || done(nodes[slot - ahead]);
    }
    return all;
  }
  /// Lists shared_nodes.
  void list_shared_nodes();
  /// Calls visit(slot, node) for each of shared_nodes, and before that prefetch(node): with many nodes what they share
  /// is in no cache of this core.
  template <class Prefetch, class Visit>
  void each_shared_node(Prefetch prefetch, Visit visit) const {
    constexpr std::size_t ahead = 8;
    const std::size_t slots = shared_nodes.size();
    for (std::size_t slot = 0; slot < slots + ahead; ++slot) {
      if (slot < slots && shared_nodes[slot] != nullptr) {
        prefetch(*shared_nodes[slot]);
      }
      if (slot >= ahead && shared_nodes[slot - ahead] != nullptr) {
        visit(static_cast<NodeNumber>(slot - ahead), *shared_nodes[slot - ahead]);
      }
    }
  }
  /// Calls `send` for the users in a list of their connection that are not lost, from UserConnection::next on, until it
  /// returns false. Returns whether it returned true for all.
  template <class Send>
  bool send_to_users(UserConnection& peers, std::span<const UserNumber> list, Send send) {
    constexpr std::size_t users_a_ring = 64, ahead = 8;
    if (peers.next == list.size()) {
      return true;
    }
    link::Sender& out = *peers.connection.out;
    out.set_quiet(true);
    bool room = true;
    while (room && peers.next < list.size()) {
      base::prefetch_object(users[list[std::min(peers.next + ahead, list.size() - 1)]].closing);
      PeerSession& user = users[list[peers.next]];
      room = user.lost || send(user);
      peers.next += room ? 1 : 0;
      if (peers.next % users_a_ring == 0) {
        out.ring_unrung();
      }
    }
    out.ring_unrung();
    out.set_quiet(false);
    return room;
  }
  /// Sends the users of a connection a message without records, once for all of them; true when it is sent. If all are
  /// lost, it is not sent.
  bool send_to_all(UserConnection& peers, messages::RunSender& run, messages::MessageType type) {
    return !any_active_user(peers) || run.pump(*peers.connection.out, head(type, messages::Endpoint::all_users()),
                                               messages::record_bytes(type, objects.state_bytes()), report().traffic,
                                               [](std::size_t, std::byte*) {});
  }
  bool any_active_user(const UserConnection& peers) const noexcept {
    return std::any_of(peers.users.begin(), peers.users.end(), [&](UserNumber user) { return !users[user].lost; });
  }
  /// Whether all threads of users have published what they host.
  bool users_have_published() const noexcept {
    return std::all_of(user_connections.begin(), user_connections.end(),
                       [&](const UserConnection& peers) { return peers.published || !any_active_user(peers); });
  }
  /// Whether all threads of users have completed the frame.
  bool users_are_done() const noexcept {
    return std::all_of(user_connections.begin(), user_connections.end(),
                       [&](const UserConnection& peers) { return peers.frame_done || !any_active_user(peers); });
  }
  /// Whether the frame needs a message of these users.
  bool awaits(const UserConnection& peers) const noexcept {
    if (stage >= FrameStage::notifying_users) {
      return !peers.frame_done && any_active_user(peers);
    }
    return awaited_users != 0 || (stage <= FrameStage::colliding && !peers.published && any_active_user(peers));
  }
  /// Adds a user, which is not connected yet.
  void connect(UserNumber user, const Connection& connection);
  /// Removes the users whose sessions are not connected any more.
  void remove_disconnected();
  /// From now on the frame needs the states of all users that are not lost.
  void await_users() noexcept { awaited_users = connected.size() - lost_users; }
  /// What was received from a user in this frame.
  PeerSession::Received& received_from(PeerSession& user) const noexcept {
    if (user.received.frame != frame) {
      user.received.begin(frame);
    }
    return user.received;
  }
  /// Whether the last states of a user have arrived in this frame.
  bool has_reported(const PeerSession& user) const noexcept {
    return user.received.frame == frame && user.received.states;
  }
  /// The user is lost from now on.
  void lose_user(PeerSession& user) noexcept {
    awaited_users -= awaited_users == 0 || has_reported(user) ? 0 : 1;
    ++lost_users;
    user.lost = true;
  }
  /// What is sent to the host before the frame begins; null if no CD node and no connected user has this endpoint.
  PeerSession::Opening* opening_of(messages::Endpoint peer);
  /// The session of a CD node or a connected user node; null for any other endpoint.
  PeerSession* session_of(messages::Endpoint endpoint) noexcept {
    if (endpoint.is_node()) {
      return &nodes[endpoint.number()];
    }
    return endpoint.is_user() && users[endpoint.number()].connected ? &users[endpoint.number()] : nullptr;
  }
  /// all_nodes() for a step that sends nodes the messages that they wait for; ServerExchange::announce() follows. Calls
  /// `send` for those nodes for which `has_message` is true. If there are many nodes, none is woken by its own message:
  /// when all messages are written, the nodes wake each other (link::WakeTree).
  template <class HasMessage, class Send>
  bool send_to_nodes(HasMessage has_message, Send send) {
    // What remains to be sent wakes its receiver as usual.
    if (!wakes_together() || is_waking()) {
      return all_nodes([&](PeerSession& node) { return !has_message(node) || send(node); });
    }
    const auto prefetch = [](const PeerSession& node) {
      base::prefetch_object(node.begin_run);
      base::prefetch_for_read(&node.connection);
    };
    const bool all = all_nodes(prefetch, [&](PeerSession& node) {
      if (!has_message(node)) {
        return true;
      }
      node.connection.out->set_quiet(true);
      const bool sent = send(node);
      node.connection.out->set_quiet(false);
      return sent;
    });
    if (!all) {
      wake_nodes();  // those whose rings are full have to read
    }
    return all;
  }
  /// Whether all nodes are woken at once. A lost node may not pass on.
  bool wakes_together() const noexcept { return wake_tree != nullptr && reports[frame & 1].lost.empty(); }
  /// Precondition: wakes_together().
  void wake_nodes() noexcept {
    woken_stage = stage;
    const std::uint64_t start_ns = telemetry::thread_cpu_ns();
    wake_tree->wake();
    rings_ms = telemetry::to_ms(telemetry::thread_cpu_ns() - start_ns);
  }
  /// Whether this stage has woken all nodes at once.
  bool is_waking() const noexcept { return wake_tree != nullptr && woken_stage == stage; }
  bool any_active_node() const noexcept {
    return std::any_of(nodes.begin(), nodes.end(), [](const PeerSession& node) { return node.is_active(); });
  }
  bool all_nodes_done() noexcept {
    return all_nodes([](const PeerSession& node) { return node.received.frame_done; });
  }
  /// Whether the contacts of the frame are known, so that a loss no longer changes them.
  bool contacts_are_final() const noexcept { return stage >= FrameStage::notifying; }
  /// Whether CD nodes host objects, so that they receive contacts from each other.
  bool nodes_host() const noexcept { return setup.deployment == Deployment::user_collision; }
  /// Whether hosts send the other nodes what these need for their sweeps.
  bool hosts_send_ghosts() const noexcept { return nodes_host() && setup.placement == Placement::region; }
  /// Lists the active nodes that also stay, ascending; if none stays, those that leave.
  void list_remaining_nodes(std::vector<NodeNumber>& remaining) const;
  /// The CD node whose region contains the position.
  NodeNumber owner_at(const Vec3d& position) const noexcept {
    std::uint32_t point[3];
    setup.space->point(position, point);
    return map.owner_at(point);
  }
  void note_host_change(std::uint32_t slot);

  FrameReport& report() noexcept { return reports[frame & 1]; }
  /// Counts a refused message or record.
  void refuse(Status reason) noexcept { ++report().refused[static_cast<std::size_t>(reason)]; }
  messages::RunHeader head(messages::MessageType type, messages::Endpoint to) const noexcept {
    return {type, messages::Endpoint::server(), to, frame, map.epoch()};
  }
  /// Sends as much of a run as the ring takes, see messages::RunSender::send(); true when all is sent.
  template <class RecordAt>
  bool send(PeerSession& session, messages::RunSender& run, messages::MessageType type, RecordAt record_at) {
    return run.send(*session.connection.out, head(type, session.self), report().traffic, record_at);
  }
  /// The same for a run without records.
  bool send_empty(PeerSession& session, messages::RunSender& run, messages::MessageType type) {
    return run.pump(*session.connection.out, head(type, session.self), 0, report().traffic,
                    [](std::size_t, std::byte*) {});
  }
};

}  // namespace ringfence::nodes
