#pragma once

#include <cstdint>
#include <span>

#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/frame/state_relay.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/objects/object_states.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Routes the contacts of a frame: has their list and phases resolved and the output lists written (ContactLedger),
/// determines the hosts of the next frame, and notifies hosts of their contacts (M4).
///
/// User nodes receive theirs from the server, CD nodes from each other. The server, as a host, reads the output lists.
///
/// Threads: belongs to the server role. Memory: that of the lists in PeerSession.
class ContactRouter {
 public:
  ContactRouter(ServerState& state, ServerExchange& exchange, ObjectStates& states, StateRelay& relay,
                Statistics& statistics) noexcept
      : state_(state), exchange_(exchange), states_(states), relay_(relay), statistics_(statistics) {}

  /// When all nodes have moved: reads what they list of host-owned objects (StepReport::next_hosts).
  void list_next_hosts();

  /// When all nodes have tested their pairs: resolves which contacts are listed, and their phases; starts the output
  /// lists.
  void resolve_phases();
  /// After list_next_hosts(), once in a frame, when the region map of the next frame is known: the hosts of the next
  /// frame, and the number of hand-overs that each node must expect. In user/collision deployment they follow the poses
  /// and the map. The nodes conclude the same from their own data.
  void assign_next_hosts();
  /// After both: starts what notify() sends to the nodes.
  void start_nodes();
  /// Sends a node what ends its frame: map, unlisted contacts, corrections, and what it gets from other nodes. Sends as
  /// much as the ring takes; true when all is sent.
  bool notify(PeerSession& node);
  /// Whether notify() has something to send. True for each node of another process until it has all.
  bool has_notice(const PeerSession& node) const noexcept { return state_.map_change.at_end || !node.end_run.done(); }
  /// Lists what notify_users() sends.
  void start_users();
  /// Sends the users their contacts. Returns false if that was done before.
  bool notify_users();
  /// Whether all of them have been sent.
  bool users_are_notified() const noexcept { return users_are_notified_; }
  /// When the frame is complete: counts its contacts, and what nodes have read from each other.
  void count_contacts();

 private:
  void start_unlisting();
  void follow(std::uint32_t slot, NodeNumber next);
  void follow_hosted(const PeerSession& node, const Host& host);
  void list_notices();
  void list_notice(std::uint32_t notice, const Found& found);
  Contact contact_of(std::uint32_t notice) const noexcept;
  /// Sends a node of another process what the ledger has decided about its contacts: which are not listed, and which
  /// have not begun.
  bool send_resolved(PeerSession& node);
  bool notify_user(PeerSession& user);

  ServerState& state_;
  ServerExchange& exchange_;
  ObjectStates& states_;
  StateRelay& relay_;
  Statistics& statistics_;
  base::FlatList<NextHostOf> next_hosts_;                   ///< scratch
  std::span<const ContactNotice> notices_, ended_notices_;  ///< of this frame, sent by the server
  bool users_are_notified_ = false;                         ///< all users have been sent their contacts of this frame
};

}  // namespace ringfence::nodes
