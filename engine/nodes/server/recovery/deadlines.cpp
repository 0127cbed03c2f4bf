#include "nodes/server/recovery/deadlines.hpp"

#include <algorithm>

namespace ringfence::nodes {

using messages::MessageType;

void Deadlines::begin() noexcept {
  nodes_abandoned_ = false;
  gates_watched_ns_ = 0;
}

bool Deadlines::check(std::uint64_t now) {
  bool changed = false;
  if (state_.setup.node_deadline_ns != 0) {
    for (PeerSession& node : state_.nodes) {
      changed |= node.is_active() && check_node(node, now);
    }
    changed |= check_gates(now);
  }
  return (state_.setup.user_deadline_ns != 0 && check_users(now)) || changed;
}

// A silent node is not necessarily lost, because it may wait for another node that is lost. So after half the deadline
// the server sends it a probe, and the node has the other half to answer.
bool Deadlines::check_node(PeerSession& node, std::uint64_t now) {
  const std::uint64_t silent = now - std::min(now, node.last_received_ns);
  if (silent <= state_.setup.node_deadline_ns / 2) {
    return false;
  }
  if (node.probed_ns == 0) {
    node.probed_ns = now;
    node.probe_run.start(0);
  }
  if (state_.stage == FrameStage::dispatching) {
    dispatch_.flush(node.self.number());
  }
  state_.send_empty(node, node.probe_run, MessageType::probe);
  if (now - node.probed_ns <= state_.setup.node_deadline_ns / 2) {
    return false;
  }
  failover_.lose(node.self.number());
  return true;
}

// The thread of a lost node may have stopped inside a read gate. Until it leaves the gate, no other node may write the
// memory that the thread reads. So after a deadline the server gives up that memory: all nodes are lost, and new nodes
// replace them.
bool Deadlines::check_gates(std::uint64_t now) {
  if (state_.stage != FrameStage::closing || nodes_abandoned_ || !state_.all_nodes_done() ||
      state_.report().lost.empty()) {
    return false;
  }
  if (gates_watched_ns_ == 0) {
    gates_watched_ns_ = now;
  }
  if (now - gates_watched_ns_ <= state_.setup.node_deadline_ns) {
    return false;
  }
  nodes_abandoned_ = true;
  state_.all_nodes([&](const PeerSession& node) {
    failover_.lose(node.self.number());
    return true;
  });
  state_.ledger.write_again();
  return true;
}

// With threads only a move may be late: what a user node does after it calls no motion model, so a silent thread has
// not run, and that is the fault of none of its user nodes. The World needs the thread before the next frame anyway.
bool Deadlines::check_users(std::uint64_t now) {
  if (state_.stage == FrameStage::starting_nodes) {
    return false;  // the frame has not started for users
  }
  if (state_.setup.order->caller != nullptr) {
    return check_moves(now);
  }
  const std::uint64_t since = state_.contacts_are_final() ? state_.notify_ns : state_.begin_ns;
  if (now - since <= state_.setup.user_deadline_ns) {
    return false;
  }
  bool changed = false;
  for (const UserConnection& peers : state_.user_connections) {
    for (const UserNumber number : peers.users) {
      PeerSession& user = state_.users[number];
      if (!user.lost && is_awaited(peers, user)) {
        count_late(user);
        changed = true;
      }
    }
  }
  return changed;
}

bool Deadlines::is_awaited(const UserConnection& peers, const PeerSession& user) const noexcept {
  if (state_.contacts_are_final()) {
    return !peers.frame_done;
  }
  return !state_.has_reported(user) || (state_.stage == FrameStage::colliding && !peers.published);
}

// If several user nodes of one thread have not reported, only the user node whose move does not end is late. The facade
// searches for such user nodes. If it finds any, it responds, and the frame waits for the other user nodes of their
// threads.
bool Deadlines::check_moves(std::uint64_t now) {
  FrameOrder& order = *state_.setup.order;
  if (order.users_moved.load(std::memory_order_acquire)) {
    for (const UserNumber user : order.stalled_users) {
      count_late(state_.users[user]);
    }
    for (const FrameOrder::MovedConnection& moved : order.moved_connections) {
      moved.connection.out->set_bell(moved.bell);
      moved.connection.in->set_bell(moved.bell);
      moved.bell->ring();  // there may be messages that were sent before set_bell()
    }
    order.users_moved.store(false, std::memory_order_release);
    return true;
  }
  const auto is_missing = [&](UserNumber user) {
    return !state_.users[user].lost && !state_.has_reported(state_.users[user]);
  };
  if (now - moves_watched_ns_ > state_.setup.user_deadline_ns / 2 &&
      std::any_of(state_.connected.begin(), state_.connected.end(), is_missing)) {
    moves_watched_ns_ = now;
    order.users_overdue.store(true, std::memory_order_release);
    order.caller->ring();
  }
  return false;
}

void Deadlines::count_late(PeerSession& user) {
  state_.lose_user(user);
  state_.report().late.emplace_back(user.self.number());
  state_.refuse(Status::late);
}

}  // namespace ringfence::nodes
