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
  if (state_.stage == FrameStage::waiting) {
    return false;
  }
  PeerSession& session = state_.nodes[node];
  if (!session.connected || session.lost) {
    return true;
  }
  session.lost = true;
  shared_.close_ghost_gates();
  state_.report().lost.emplace_back(session.id);
  const bool again = !state_.contacts_are_final();
  bool any_left = false;
  for (PeerSession& other : state_.nodes) {
    if (other.connected && !other.lost) {
      any_left = true;
      other.loss.records.push_back({node, again ? 1u : 0u, 0});
      other.loss.lost_run.start(other.loss.records.size());
    }
  }
  losses_pending_ = true;
  if (!again) {
    state_.ledger.lose(node);
    cancel_hand_overs(node);
    return true;
  }
  fallback_slot_ = any_left ? no_node : node;
  reassign_cells();
  recover_objects(node);
  detect_again();
  if (!any_left) {
    state_.setup.order->fallback_slot = node;
    state_.setup.order->fallback_wanted.store(true, std::memory_order_release);
    if (state_.setup.order->caller != nullptr) {
      state_.setup.order->caller->ring();
    }
  }
  return true;
}

// Called after all messages have been read, not while they are: lose() changes the stage, the map and the lists over
// which the readers iterate.
void ServerRole::lose_broken_nodes() {
  any_broken_ = false;
  for (const PeerSession& session : state_.nodes) {
    if (session.broken && !session.lost) {
      lose(session.self.number());
    }
  }
}

// Cells of nodes that are gone go to the remaining ones, in consecutive runs, so that a region becomes few pieces. If
// no node is left, the fallback node gets all cells.
void ServerRole::reassign_cells() {
  if (fallback_slot_ != no_node) {
    remaining_.assign(1, fallback_slot_);
  } else {
    state_.list_remaining_nodes(remaining_);
  }
  table_.assign(state_.map.table().begin(), state_.map.table().end());
  const auto is_orphan = [&](std::uint32_t entry) {
    return !regions::RegionMap::is_cut(entry) &&
           (entry >= state_.nodes.size() || !state_.nodes[entry].connected || state_.nodes[entry].lost);
  };
  const auto orphans = static_cast<std::size_t>(std::count_if(table_.begin(), table_.end(), is_orphan));
  std::size_t passed = 0;
  for (std::uint32_t& entry : table_) {
    if (is_orphan(entry)) {
      entry = remaining_[passed * remaining_.size() / orphans];
      ++passed;
    }
  }
  state_.map.assign(table_, static_cast<std::uint32_t>(state_.nodes.size()), state_.map.epoch() + 1);
}

void ServerRole::reclaim(std::uint32_t slot) {
  state_.objects.set_host(slot, Endpoint::server());
  state_.objects.marks(slot) =
      static_cast<ObjectMarks>((state_.objects.marks(slot) & ~host_owned_mark) | recovered_mark);
  recovered_ = true;
}

void ServerRole::recover_objects(NodeNumber node) {
  const Endpoint gone = Endpoint::node(node);
  while (recovery_host_.size() != 0) {
    recovery_host_.drop(recovery_host_[0].object.number);
  }
  states_.store_kept(state_.nodes[node], state_.frame - 1);
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (!state_.objects.alive(slot) || state_.objects.host(slot) != gone) {
      continue;
    }
    reclaim(slot);
    if ((state_.objects.marks(slot) & reported_mark) == 0) {
      recovery_host_.adopt(state_.objects.hand_over(slot), state_.objects.state(slot));
    }
  }
  recovery_host_.read_contacts(state_.ledger.contacts(state_.frame - 1), state_.ledger.keys(state_.frame - 1));
  recovery_host_.move(state_.frame);
  states_.apply_moves(recovery_host_);
}

void ServerRole::detect_again() {
  if (state_.stage == FrameStage::dispatching || state_.stage == FrameStage::colliding) {
    state_.stage = FrameStage::moving;
  }
  state_.ledger.begin(state_.frame);
  statistics_.forget_results();
  for (PeerSession& session : state_.nodes) {
    session.received.narrow_done = false;
    session.loss.map_run.start(state_.map.table().size());
  }
  state_.map_change.updates = Dispatch::UpdateScope::all_objects;
  state_.map_change.rescan_hosts = true;
}

// Called when the contacts are known. A hand-over from the lost node may or may not arrive. In both cases its receiver
// drops the object at the next cut, and the server then hands the object over.
void ServerRole::cancel_hand_overs(NodeNumber node) {
  states_.store_kept(state_.nodes[node], state_.frame);
  for (const HandOver& change : state_.hand_overs) {
    PeerSession& to = state_.nodes[change.to];
    if (change.from != node || to.lost) {
      continue;
    }
    if (to.closing.end_run.done()) {
      ++to.loss.records.back().hand_overs;
    } else {
      --to.closing.hand_overs;
    }
    to.opening.drops.push_back(change.slot);
    reclaim(change.slot);
  }
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (state_.objects.alive(slot) && state_.objects.host(slot) == Endpoint::node(node)) {
      reclaim(slot);
    }
  }
}

bool ServerRole::send_losses() {
  if (fallback_slot_ != no_node && !connect_fallback()) {
    return false;
  }
  losses_pending_ = !state_.all_nodes([&](PeerSession& session) { return send_losses(session); });
  return !losses_pending_;
}

bool ServerRole::send_losses(PeerSession& session) {
  if (!session.loss.records.empty()) {
    const bool sent = session.loss.lost_run.pump(
        *session.connection.out, state_.head(MessageType::lost, session.self), sizeof(messages::LostRecord),
        state_.report().traffic, [&](std::size_t i, std::byte* where) {
          std::memcpy(where, &session.loss.records[i], sizeof session.loss.records[i]);
        });
    if (!sent) {
      return false;
    }
    session.loss.records.clear();
  }
  if (!session.loss.map_run.done() && !state_.send_map(session, session.loss.map_run)) {
    return false;
  }
  // Other nodes have already received frame_begin. A fallback node joins while the frame is running, so it receives it
  // here.
  return state_.stage == FrameStage::starting_nodes ||
         session.opening.begin_run.pump(*session.connection.out, state_.head(MessageType::frame_begin, session.self), 0,
                                        state_.report().traffic, [](std::size_t, std::byte*) {});
}

// Connects the fallback node, which the facade creates when the last node is lost before the contacts are known. The
// server's thread steps that node. Returns false while the facade has not created it.
bool ServerRole::connect_fallback() {
  FrameOrder& order = *state_.setup.order;
  if (!order.fallback_ready.load(std::memory_order_acquire)) {
    return false;
  }
  order.fallback_ready.store(false, std::memory_order_relaxed);
  const NodeNumber slot = std::exchange(fallback_slot_, no_node);
  PeerSession& session = state_.nodes[slot];
  const std::size_t in_report = session.in_report;
  session = {};
  session.self = Endpoint::node(slot);
  session.id = order.fallback_id;
  session.in_report = in_report;
  state_.report().nodes[in_report] = {.id = NodeId(session.id)};
  session.connection = order.fallback;
  session.connected = true;
  session.last_received_ns = telemetry::now_ns();
  session.opening.begin_run.start(0);
  relay_.order(session);
  state_.ledger.join(slot, state_.frame);
  return true;
}

// At the cut: what lost nodes owned goes to the others. Objects may have changed their hosts since the lost nodes'
// cells were reassigned within the frame, so the nodes receive the map and all objects again in any case.
void ServerRole::replace_lost_nodes() {
  reassign_cells();
  state_.map_change.updates = Dispatch::UpdateScope::all_objects;
  state_.map_change.rescan_hosts = state_.map_change.precedes_frame = true;
}

// At the cut: gives every object that the server holds for a lost node to the node whose region contains it.
void ServerRole::rehost_recovered() {
  if (!std::exchange(recovered_, false)) {
    return;
  }
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (state_.objects.alive(slot) && (state_.objects.marks(slot) & recovered_mark) != 0) {
      const NodeNumber node = hosting_.node_at(state_.objects.row(slot).pose.position, state_.map);
      state_.objects.set_host(slot, Endpoint::node(node));
      state_.nodes[node].opening.adoptions.push_back(slot);
      state_.note_host_change(slot);
      ++state_.report().handed_over;
    }
    state_.objects.marks(slot) &= static_cast<ObjectMarks>(~recovered_mark);
  }
}

// Refuses the messages of a lost node. Returns whether there were any.
bool ServerRole::drain_lost(PeerSession& session) {
  bool any = false;
  for (auto bytes = session.connection.in->next(); !bytes.empty(); bytes = session.connection.in->next()) {
    state_.refuse(Status::late);
    any = true;
  }
  if (any) {
    session.connection.in->release();
  }
  return any;
}

// Called when the frame does not progress. Returns whether a node was lost or a user node was late.
bool ServerRole::check_deadlines() {
  if (state_.stage == FrameStage::waiting ||
      (state_.setup.node_deadline_ns == 0 && state_.setup.user_deadline_ns == 0)) {
    return false;
  }
  const std::uint64_t now = telemetry::now_ns();
  bool changed = false;
  for (PeerSession& session : state_.nodes) {
    changed |=
        state_.setup.node_deadline_ns != 0 && session.connected && !session.lost && check_node_deadline(session, now);
  }
  changed |= state_.setup.node_deadline_ns != 0 && watch_gates(now);
  return (state_.setup.user_deadline_ns != 0 && watch_users(now)) || changed;
}

// The thread of a lost node may have stopped inside a read gate. Until it leaves the gate, no other node may write the
// memory that the thread reads. So after a deadline the server gives up that memory: all nodes are lost, and new nodes
// replace them.
bool ServerRole::watch_gates(std::uint64_t now) {
  if (state_.stage != FrameStage::closing || nodes_abandoned_ || !all_nodes_done() || state_.report().lost.empty()) {
    return false;
  }
  if (gates_watched_ns_ == 0) {
    gates_watched_ns_ = now;
  }
  if (now - gates_watched_ns_ <= state_.setup.node_deadline_ns) {
    return false;
  }
  nodes_abandoned_ = true;
  state_.all_nodes([&](const PeerSession& session) { return lose(session.self.number()); });
  state_.ledger.write_again();
  return true;
}

// A silent node is not necessarily lost, because it may wait for another node that is lost. So after half the deadline
// the server sends it a probe, and the node has the other half to answer.
bool ServerRole::check_node_deadline(PeerSession& session, std::uint64_t now) {
  const std::uint64_t silent = now - std::min(now, session.last_received_ns);
  if (silent <= state_.setup.node_deadline_ns / 2) {
    return false;
  }
  if (session.probed_ns == 0) {
    session.probed_ns = now;
    session.probe_run.start(0);
  }
  if (state_.stage == FrameStage::dispatching) {
    dispatch_.flush(session.self.number(), state_.head(MessageType::pairs, session.self), state_.report().traffic);
  }
  session.probe_run.pump(*session.connection.out, state_.head(MessageType::probe, session.self), 0,
                         state_.report().traffic, [](std::size_t, std::byte*) {});
  if (now - session.probed_ns <= state_.setup.node_deadline_ns / 2) {
    return false;
  }
  lose(session.self.number());
  return true;
}

bool ServerRole::watch_users(std::uint64_t now) {
  if (state_.stage == FrameStage::starting_nodes) {
    return false;  // the frame has not started for users
  }
  if (!state_.contacts_are_final() && state_.setup.order->caller != nullptr) {
    return watch_moves(now);
  }
  bool changed = false;
  for (const UserNumber number : state_.connected) {
    PeerSession& user = state_.users[number];
    if (!user.lost && is_overdue(user, now)) {
      count_late(user);
      changed = true;
    }
  }
  return changed;
}

bool ServerRole::is_overdue(const PeerSession& user, std::uint64_t now) const noexcept {
  const bool awaited = state_.contacts_are_final() ? !user.received.frame_done : !user.received.states;
  const std::uint64_t since = state_.contacts_are_final() ? state_.notify_ns : state_.begin_ns;
  return awaited && now - since > state_.setup.user_deadline_ns;
}

void ServerRole::count_late(PeerSession& user) {
  user.lost = true;
  state_.report().late.emplace_back(user.self.number());
  state_.refuse(Status::late);
}

// If several user nodes of one thread have not reported, only the user node whose move does not end is late. The facade
// searches for such user nodes. If it finds any, it responds, and the frame waits for the other user nodes of their
// threads.
bool ServerRole::watch_moves(std::uint64_t now) {
  FrameOrder& order = *state_.setup.order;
  if (order.users_moved.load(std::memory_order_acquire)) {
    for (const UserNumber user : order.stalled_users) {
      count_late(state_.users[user]);
    }
    for (const FrameOrder::MovedUser& moved : order.moved_users) {
      const Connection& connection = state_.users[moved.user].connection;
      connection.out->set_bell(moved.bell);
      connection.in->set_bell(moved.bell);
      moved.bell->ring();  // there may be messages that were sent before set_bell()
    }
    order.users_moved.store(false, std::memory_order_release);
    return true;
  }
  const auto is_missing = [&](UserNumber user) {
    return !state_.users[user].lost && !state_.users[user].received.states;
  };
  if (now - moves_watched_ns_ > state_.setup.user_deadline_ns / 2 &&
      std::any_of(state_.connected.begin(), state_.connected.end(), is_missing)) {
    moves_watched_ns_ = now;
    order.users_overdue.store(true, std::memory_order_release);
    order.caller->ring();
  }
  return false;
}

}  // namespace ringfence::nodes
