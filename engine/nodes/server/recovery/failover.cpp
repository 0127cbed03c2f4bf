#include "nodes/server/recovery/failover.hpp"

#include <algorithm>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

Failover::Failover(ServerState& state, ServerExchange& exchange, ObjectStates& states, StateRelay& relay,
                   Statistics& statistics)
    : state_(state),
      exchange_(exchange),
      states_(states),
      relay_(relay),
      statistics_(statistics),
      recovery_host_(state.setup.model, 0) {
  recovery_host_.sense(state.setup.sense);
}

void Failover::lose(NodeNumber node) {
  PeerSession& session = state_.nodes[node];
  if (!session.is_active()) {
    return;
  }
  session.lost = true;
  exchange_.dismiss(session);
  exchange_.close_ghost_gates();
  state_.report().lost.emplace_back(session.id);
  announce(node, !state_.contacts_are_final());
  if (state_.contacts_are_final()) {
    state_.ledger.lose(node);
    exchange_.cancel_contacts(node);
    cancel_hand_overs(node);
    return;
  }
  const bool any_left = state_.any_active_node();
  fallback_slot_ = any_left ? no_node : node;
  reassign_cells();
  recover_objects(node);
  detect_again();
  if (!any_left) {
    request_fallback();
  }
}

void Failover::lose_broken_nodes() {
  for (const PeerSession& session : state_.nodes) {
    if (session.broken && !session.lost) {
      lose(session.self.number());
    }
  }
}

void Failover::announce(NodeNumber node, bool detect_again) {
  state_.all_nodes([&](PeerSession& other) {
    other.loss.records.push_back({node, detect_again ? 1u : 0u, 0, 0});
    other.loss.lost_run.start(other.loss.records.size());
    return true;
  });
  pending_ = true;
}

// Cells of nodes that are gone go to the remaining ones, in consecutive runs, so that a region becomes few pieces. If
// no node is left, the fallback node gets all cells.
void Failover::reassign_cells() {
  if (fallback_slot_ != no_node) {
    remaining_.assign(1, fallback_slot_);
  } else {
    state_.list_remaining_nodes(remaining_);
  }
  table_.assign(state_.map.table().begin(), state_.map.table().end());
  const auto is_orphan = [&](std::size_t word) {
    const std::uint32_t entry = table_[word];
    return !regions::RegionMap::is_plane(word, state_.map.grid()) && !regions::RegionMap::is_cut(entry) &&
           (entry >= state_.nodes.size() || !state_.nodes[entry].connected || state_.nodes[entry].lost);
  };
  std::size_t orphans = 0;
  for (std::size_t word = 0; word < table_.size(); ++word) {
    orphans += is_orphan(word) ? 1 : 0;
  }
  std::size_t passed = 0;
  for (std::size_t word = 0; word < table_.size(); ++word) {
    if (is_orphan(word)) {
      table_[word] = remaining_[passed * remaining_.size() / orphans];
      ++passed;
    }
  }
  state_.map.assign(table_, static_cast<std::uint32_t>(state_.nodes.size()), state_.map.epoch() + 1);
}

void Failover::reclaim(std::uint32_t slot) {
  state_.objects.set_host(slot, Endpoint::server());
  state_.objects.marks(slot) =
      static_cast<ObjectMarks>((state_.objects.marks(slot) & ~host_owned_mark) | recovered_mark);
  recovered_ = true;
}

void Failover::recover_objects(NodeNumber node) {
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
  recovery_host_.contacts().read(state_.ledger.contacts(state_.frame - 1), state_.ledger.keys(state_.frame - 1));
  recovery_host_.set_sensed(state_.setup.publications->sensed);
  recovery_host_.move(state_.frame);
  states_.apply_moves(recovery_host_);
}

void Failover::detect_again() {
  if (state_.stage == FrameStage::dispatching || state_.stage == FrameStage::colliding) {
    state_.stage = FrameStage::moving;
  }
  state_.ledger.begin(state_.frame);
  exchange_.begin();
  statistics_.forget_results();
  state_.all_nodes([&](PeerSession& session) {
    session.received.narrow_done = false;
    session.loss.map_run.start(state_.map.table().size());
    return true;
  });
  state_.map_change.updates = UpdateScope::all_objects;
  state_.map_change.rescan_hosts = true;
}

// Called when the contacts are known. A hand-over from the lost node may or may not arrive. In both cases its receiver
// drops the object at the next cut, and the server then hands the object over.
void Failover::cancel_hand_overs(NodeNumber node) {
  states_.store_kept(state_.nodes[node], state_.frame);
  for (const HandOver& change : state_.hand_overs) {
    PeerSession& to = state_.nodes[change.to];
    if (change.from != node || to.lost) {
      continue;
    }
    if (to.end_run.done()) {
      ++to.loss.records.back().hand_overs;
    } else {
      --to.hand_overs;
    }
    state_.opening_of(to.self)->drops.push_back(change.slot);
    reclaim(change.slot);
  }
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (state_.objects.alive(slot) && state_.objects.host(slot) == Endpoint::node(node)) {
      reclaim(slot);
    }
  }
}

// The facade creates the node, and the server's thread steps it.
void Failover::request_fallback() {
  FrameOrder& order = *state_.setup.order;
  order.fallback_slot = fallback_slot_;
  order.fallback_wanted.store(true, std::memory_order_release);
  if (order.caller != nullptr) {
    order.caller->ring();
  }
}

// Returns false while the facade has not created the node.
bool Failover::connect_fallback() {
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
  exchange_.start_run(session.begin_run, MessageType::frame_begin, 0);
  relay_.order(session);
  exchange_.admit(session);
  state_.ledger.join(slot, state_.frame);
  return true;
}

bool Failover::send() {
  if (fallback_slot_ != no_node && !connect_fallback()) {
    return false;
  }
  pending_ = !state_.all_nodes([&](PeerSession& session) { return send(session); });
  return !pending_;
}

bool Failover::send(PeerSession& session) {
  if (!session.loss.records.empty()) {
    if (!state_.send(session, session.loss.lost_run, MessageType::lost,
                     [&](std::size_t i) { return session.loss.records[i]; })) {
      return false;
    }
    session.loss.records.clear();
  }
  if (!exchange_.send_map(session, session.loss.map_run)) {
    return false;
  }
  // Other nodes have already received frame_begin. A fallback node joins while the frame is running, so it receives it
  // here, unless it follows the announcement.
  return state_.stage == FrameStage::starting_nodes ||
         state_.send_empty(session, session.begin_run, MessageType::frame_begin);
}

// Objects may have changed their hosts since the cells of lost nodes were reassigned within the frame, so the nodes
// receive the map and all objects again in any case.
void Failover::replace_lost_nodes() {
  reassign_cells();
  state_.map_change.updates = UpdateScope::all_objects;
  state_.map_change.rescan_hosts = state_.map_change.precedes_frame = true;
}

void Failover::rehost_recovered() {
  if (!std::exchange(recovered_, false)) {
    return;
  }
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (state_.objects.alive(slot) && (state_.objects.marks(slot) & recovered_mark) != 0) {
      const NodeNumber node = state_.owner_at(state_.objects.row(slot).pose.position);
      state_.objects.set_host(slot, Endpoint::node(node));
      state_.opening_of(Endpoint::node(node))->adoptions.push_back(slot);
      state_.note_host_change(slot);
      ++state_.report().handed_over;
    }
    state_.objects.marks(slot) &= static_cast<ObjectMarks>(~recovered_mark);
  }
}

}  // namespace ringfence::nodes
