// Loss of CD nodes, and deadlines of user nodes.
//
// The server has C(k-1) and S(k-1) of every object: in its table, or in memory that it shares with the host. Each S(k)
// that was reported is final. So the loss of a node before the contacts are known costs only time: the other nodes get
// its cells, the server moves those of its objects that were not reported, and the frame is detected again under a new
// map. The new epoch invalidates the results found under the old map.
//
// If a node is lost after the contacts are known, only its objects have to be recovered: the server becomes the host of
// all objects that the node hosts, hands over or receives. At the next cut the slots of lost nodes become free, and the
// server gives every recovered object, with its contacts, to the node whose region contains it.
#include <algorithm>
#include <cstring>
#include <utility>

#include "nodes/server/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

bool ServerRole::lose(NodeNumber node) {
  if (stage_ == Stage::waiting) {
    return false;
  }
  PeerSession& session = nodes_[node];
  if (!session.connected || session.lost) {
    return true;
  }
  session.lost = true;
  close_ghost_gates();
  node_connections_[node] = {};
  report().lost.emplace_back(session.id);
  const bool again = !contacts_are_final();
  bool any_left = false;
  for (PeerSession& other : nodes_) {
    if (other.connected && !other.lost) {
      any_left = true;
      other.losses.push_back({node, again ? 1u : 0u, 0});
      other.lost_run.start(other.losses.size());
    }
  }
  losses_pending_ = true;
  if (!again) {
    ledger_.lose(node);
    cancel_hand_overs(node);
    return true;
  }
  fallback_slot_ = any_left ? no_node : node;
  reassign_cells();
  recover_objects(node);
  detect_again();
  if (!any_left) {
    setup_.order->fallback_slot = node;
    setup_.order->fallback_wanted.store(true, std::memory_order_release);
    if (setup_.order->caller != nullptr) {
      setup_.order->caller->ring();
    }
  }
  return true;
}

// Called after all messages have been read, not while they are: lose() changes the stage, the map and the lists over
// which the readers iterate.
void ServerRole::lose_broken_nodes() {
  any_broken_ = false;
  for (const PeerSession& session : nodes_) {
    if (session.broken && !session.lost) {
      lose(session.self.number());
    }
  }
}

// Those of the nodes that are not lost which also stay; if none stays, those that leave.
std::span<const NodeNumber> ServerRole::remaining_nodes() {
  remaining_.clear();
  for (const bool leaving : {false, true}) {
    for (const PeerSession& session : nodes_) {
      if (session.connected && !session.lost && session.leaving == leaving) {
        remaining_.push_back(session.self.number());
      }
    }
    if (!remaining_.empty()) {
      break;
    }
  }
  return remaining_;
}

// Cells of nodes that are gone go to the remaining ones, in consecutive runs, so that a region becomes few pieces. If
// no node is left, the fallback node gets all cells.
void ServerRole::reassign_cells() {
  const std::span<const NodeNumber> remaining =
      fallback_slot_ != no_node ? std::span<const NodeNumber>(&fallback_slot_, 1) : remaining_nodes();
  table_.assign(map_.table().begin(), map_.table().end());
  const auto is_orphan = [&](std::uint32_t entry) {
    return !regions::RegionMap::is_cut(entry) &&
           (entry >= nodes_.size() || !nodes_[entry].connected || nodes_[entry].lost);
  };
  const auto orphans = static_cast<std::size_t>(std::count_if(table_.begin(), table_.end(), is_orphan));
  std::size_t passed = 0;
  for (std::uint32_t& entry : table_) {
    if (is_orphan(entry)) {
      entry = remaining[passed * remaining.size() / orphans];
      ++passed;
    }
  }
  map_.assign(table_, static_cast<std::uint32_t>(nodes_.size()), map_.epoch() + 1);
}

// Stores the host-owned states of a lost node. Its thread may still run, but it no longer writes the states of `frame`.
void ServerRole::read_host_owned(NodeNumber node, std::uint64_t frame) {
  const PeerSession& session = nodes_[node];
  if (session.connection.node_contacts == nullptr) {
    return;
  }
  const HostOwnedStates& kept_states = session.connection.node_contacts->host_states;
  const std::span<const HostOwnedState> states = kept_states.of(frame);
  for (std::size_t i = 0; i < states.size(); ++i) {
    store_state(session, frame, states[i].object, states[i].pose, kept_states.state(frame, i));
  }
}

void ServerRole::reclaim(std::uint32_t slot) {
  objects_.set_host(slot, Endpoint::server());
  objects_.marks(slot) = static_cast<ObjectMarks>((objects_.marks(slot) & ~host_owned_mark) | recovered_mark);
  recovered_ = true;
}

void ServerRole::recover_objects(NodeNumber node) {
  const Endpoint gone = Endpoint::node(node);
  while (recovery_host_.size() != 0) {
    recovery_host_.drop(recovery_host_[0].object.number);
  }
  read_host_owned(node, frame_ - 1);
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (!objects_.alive(slot) || objects_.host(slot) != gone) {
      continue;
    }
    reclaim(slot);
    if ((objects_.marks(slot) & reported_mark) == 0) {
      recovery_host_.adopt(objects_.hand_over(slot), objects_.state(slot));
    }
  }
  recovery_host_.read_contacts(ledger_.contacts(frame_ - 1), ledger_.keys(frame_ - 1));
  recovery_host_.move(frame_);
  apply_moves(recovery_host_);
}

void ServerRole::detect_again() {
  if (stage_ == Stage::dispatching || stage_ == Stage::colliding) {
    stage_ = Stage::moving;
  }
  ledger_.begin(frame_);
  FrameReport& frame = report();
  frame.candidates = frame.tested = frame.accepted = frame.failed_supports = 0;
  for (NodeReport& node : frame.nodes) {
    node = {.id = node.id};
  }
  for (PeerSession& session : nodes_) {
    session.narrow_done_received = false;
    session.new_map_run.start(map_.table().size());
  }
  update_scope_ = Dispatch::UpdateScope::all_objects;
  rescan_hosts_ = true;
}

// Called when the contacts are known. A hand-over from the lost node may or may not arrive. In both cases its receiver
// drops the object at the next cut, and the server then hands the object over.
void ServerRole::cancel_hand_overs(NodeNumber node) {
  read_host_owned(node, frame_);
  for (const HandOver& change : hand_overs_) {
    PeerSession& to = nodes_[change.to];
    if (change.from != node || to.lost) {
      continue;
    }
    if (to.end_run.done()) {
      ++to.losses.back().hand_overs;
    } else {
      --to.hand_overs;
    }
    to.drops.push_back(change.slot);
    reclaim(change.slot);
  }
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (objects_.alive(slot) && objects_.host(slot) == Endpoint::node(node)) {
      reclaim(slot);
    }
  }
}

bool ServerRole::send_losses() {
  if (fallback_slot_ != no_node && !connect_fallback()) {
    return false;
  }
  losses_pending_ = !all_nodes([&](PeerSession& session) { return send_losses(session); });
  return !losses_pending_;
}

bool ServerRole::send_losses(PeerSession& session) {
  if (!session.losses.empty()) {
    const bool sent = session.lost_run.pump(
        *session.connection.out, head(MessageType::lost, session.self), sizeof(messages::LostRecord), report().traffic,
        [&](std::size_t i, std::byte* where) { std::memcpy(where, &session.losses[i], sizeof session.losses[i]); });
    if (!sent) {
      return false;
    }
    session.losses.clear();
  }
  if (!session.new_map_run.done() && !send_map(session, session.new_map_run)) {
    return false;
  }
  // Other nodes have already received frame_begin. A fallback node joins while the frame is running, so it receives it
  // here.
  return stage_ == Stage::starting_nodes ||
         session.begin_run.pump(*session.connection.out, head(MessageType::frame_begin, session.self), 0,
                                report().traffic, [](std::size_t, std::byte*) {});
}

// Connects the fallback node, which the facade creates when the last node is lost before the contacts are known. The
// server's thread steps that node. Returns false while the facade has not created it.
bool ServerRole::connect_fallback() {
  FrameOrder& order = *setup_.order;
  if (!order.fallback_ready.load(std::memory_order_acquire)) {
    return false;
  }
  order.fallback_ready.store(false, std::memory_order_relaxed);
  const NodeNumber slot = std::exchange(fallback_slot_, no_node);
  PeerSession& session = nodes_[slot];
  const std::size_t in_report = session.in_report;
  session = {};
  session.self = Endpoint::node(slot);
  session.id = order.fallback_id;
  session.in_report = in_report;
  report().nodes[in_report] = {.id = NodeId(session.id)};
  session.connection = order.fallback;
  session.connected = true;
  session.last_received_ns = telemetry::now_ns();
  session.begin_run.start(0);
  order_relay(session);
  ledger_.join(slot, frame_);
  node_connections_[slot] = session.connection;
  return true;
}

// At the cut: what lost nodes owned goes to the others. Objects may have changed their hosts since the lost nodes'
// cells were reassigned within the frame, so the nodes receive the map and all objects again in any case.
void ServerRole::replace_lost_nodes() {
  reassign_cells();
  update_scope_ = Dispatch::UpdateScope::all_objects;
  rescan_hosts_ = map_precedes_frame_ = true;
}

// At the cut: gives every object that the server holds for a lost node to the node whose region contains it.
void ServerRole::rehost_recovered() {
  if (!std::exchange(recovered_, false)) {
    return;
  }
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (objects_.alive(slot) && (objects_.marks(slot) & recovered_mark) != 0) {
      const NodeNumber node = hosting_.node_at(objects_.row(slot).pose.position, map_);
      objects_.set_host(slot, Endpoint::node(node));
      nodes_[node].adoptions.push_back(slot);
      note_host_change(slot);
      ++report().handed_over;
    }
    objects_.marks(slot) &= static_cast<ObjectMarks>(~recovered_mark);
  }
}

// Refuses the messages of a lost node. Returns whether there were any.
bool ServerRole::drain_lost(PeerSession& session) {
  bool any = false;
  for (auto bytes = session.connection.in->next(); !bytes.empty(); bytes = session.connection.in->next()) {
    refuse(Status::late);
    any = true;
  }
  if (any) {
    session.connection.in->release();
  }
  return any;
}

// Called when the frame does not progress. Returns whether a node was lost or a user node was late.
bool ServerRole::check_deadlines() {
  if (stage_ == Stage::waiting || (setup_.node_deadline_ns == 0 && setup_.user_deadline_ns == 0)) {
    return false;
  }
  const std::uint64_t now = telemetry::now_ns();
  bool changed = false;
  for (PeerSession& session : nodes_) {
    changed |= setup_.node_deadline_ns != 0 && session.connected && !session.lost && check_node_deadline(session, now);
  }
  changed |= setup_.node_deadline_ns != 0 && watch_gates(now);
  return (setup_.user_deadline_ns != 0 && watch_users(now)) || changed;
}

// The thread of a lost node may have stopped inside a read gate. Until it leaves the gate, no other node may write the
// memory that the thread reads. So after a deadline the server gives up that memory: all nodes are lost, and new nodes
// replace them.
bool ServerRole::watch_gates(std::uint64_t now) {
  if (stage_ != Stage::closing || nodes_abandoned_ || !all_nodes_done() || report().lost.empty()) {
    return false;
  }
  if (gates_watched_ns_ == 0) {
    gates_watched_ns_ = now;
  }
  if (now - gates_watched_ns_ <= setup_.node_deadline_ns) {
    return false;
  }
  nodes_abandoned_ = true;
  all_nodes([&](const PeerSession& session) { return lose(session.self.number()); });
  ledger_.write_again();
  return true;
}

// A silent node is not necessarily lost, because it may wait for another node that is lost. So after half the deadline
// the server sends it a probe, and the node has the other half to answer.
bool ServerRole::check_node_deadline(PeerSession& session, std::uint64_t now) {
  const std::uint64_t silent = now - std::min(now, session.last_received_ns);
  if (silent <= setup_.node_deadline_ns / 2) {
    return false;
  }
  if (session.probed_ns == 0) {
    session.probed_ns = now;
    session.probe_run.start(0);
  }
  if (stage_ == Stage::dispatching) {
    dispatch_.flush(session.self.number(), session.connection, head(MessageType::pairs, session.self),
                    report().traffic);
  }
  session.probe_run.pump(*session.connection.out, head(MessageType::probe, session.self), 0, report().traffic,
                         [](std::size_t, std::byte*) {});
  if (now - session.probed_ns <= setup_.node_deadline_ns / 2) {
    return false;
  }
  lose(session.self.number());
  return true;
}

bool ServerRole::watch_users(std::uint64_t now) {
  if (stage_ == Stage::starting_nodes) {
    return false;  // the frame has not started for users
  }
  if (!contacts_are_final() && setup_.order->caller != nullptr) {
    return watch_moves(now);
  }
  bool changed = false;
  for (const UserNumber number : connected_) {
    PeerSession& user = users_[number];
    if (!user.lost && is_overdue(user, now)) {
      count_late(user);
      changed = true;
    }
  }
  return changed;
}

bool ServerRole::is_overdue(const PeerSession& user, std::uint64_t now) const noexcept {
  const bool awaited = contacts_are_final() ? !user.frame_done_received : !user.states_received;
  const std::uint64_t since = contacts_are_final() ? notify_ns_ : begin_ns_;
  return awaited && now - since > setup_.user_deadline_ns;
}

void ServerRole::count_late(PeerSession& user) {
  user.lost = true;
  report().late.emplace_back(user.self.number());
  refuse(Status::late);
}

// If several user nodes of one thread have not reported, only the user node whose move does not end is late. The facade
// searches for such user nodes. If it finds any, it responds, and the frame waits for the other user nodes of their
// threads.
bool ServerRole::watch_moves(std::uint64_t now) {
  FrameOrder& order = *setup_.order;
  if (order.users_moved.load(std::memory_order_acquire)) {
    for (const UserNumber user : order.stalled_users) {
      count_late(users_[user]);
    }
    for (const FrameOrder::MovedUser& moved : order.moved_users) {
      const Connection& connection = users_[moved.user].connection;
      connection.out->set_bell(moved.bell);
      connection.in->set_bell(moved.bell);
      moved.bell->ring();  // there may be messages that were sent before set_bell()
    }
    order.users_moved.store(false, std::memory_order_release);
    return true;
  }
  const auto is_missing = [&](UserNumber user) { return !users_[user].lost && !users_[user].states_received; };
  if (now - moves_watched_ns_ > setup_.user_deadline_ns / 2 &&
      std::any_of(connected_.begin(), connected_.end(), is_missing)) {
    moves_watched_ns_ = now;
    order.users_overdue.store(true, std::memory_order_release);
    order.caller->ring();
  }
  return false;
}

}  // namespace ringfence::nodes
