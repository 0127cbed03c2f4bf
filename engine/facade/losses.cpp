// Lost CD nodes, and the fallback node that replaces the last one.
#include <algorithm>
#include <exception>
#include <string>
#include <utility>

#include "facade/implementation.hpp"

namespace ringfence {

using facade::Steppable;
using facade::User;
using facade::UserThread;

// Returns true when the frame is complete, false if memory ran out.
bool World::Implementation::await_frame() {
  const auto is_complete = [&] { return order.completed.load(std::memory_order_acquire) == begun; };
  while (!is_complete()) {
    caller_bell.wait([&] {
      return is_complete() || order.fallback_wanted.load(std::memory_order_acquire) ||
             order.users_overdue.load(std::memory_order_acquire) || halt.is_set();
    });
    if (halt.is_set()) {
      return false;
    }
    if (order.fallback_wanted.exchange(false, std::memory_order_acquire)) {
      fallback();
    }
    if (order.users_overdue.exchange(false, std::memory_order_acquire)) {
      watch_user_threads();
    }
  }
  return true;
}

// Called when user nodes have not reported their moves in time. A thread has stalled if it is in the same move as at
// the last check, half a deadline ago.
void World::Implementation::watch_user_threads() {
  const std::uint64_t now = telemetry::now_ns();
  const auto apart_ns = static_cast<std::uint64_t>(config.deadlines.user_ms * 0.25e6);  // allows for jitter
  if (order.users_moved.load(std::memory_order_acquire) || now - user_threads_watched_ns < apart_ns) {
    return;
  }
  user_threads_watched_ns = now;
  order.stalled_users.clear();
  order.moved_users.clear();
  for (std::size_t thread = 0; thread < user_threads.size(); ++thread) {
    const nodes::MoveWatch::Move move = user_threads[thread]->watch.current();
    if (move == std::exchange(user_threads[thread]->seen, move) && move != nodes::MoveWatch::none) {
      abandon(thread);
    }
  }
  if (!order.stalled_users.empty()) {
    order.users_moved.store(true, std::memory_order_release);
    server_bell()->ring();
  }
}

// The stalled thread keeps the user node in whose move it is. A new thread steps its other user nodes, in this frame
// too.
void World::Implementation::abandon(std::size_t thread) {
  std::unique_ptr<UserThread> replacement;
  try {
    replacement = make_user_thread();
  } catch (const std::exception& error) {
    log(LogLevel::error, std::string("no thread can be created to replace a stalled one (") + error.what() +
                             "): the frame waits for a user node to move");
    return;
  }
  UserThread& stalled = *user_threads[thread];
  if (!stalled.watch.abandon(stalled.seen)) {
    return;  // the move has ended
  }
  stalled.worker->dismiss();
  const UserNumber late = nodes::MoveWatch::user_of(stalled.seen);
  User& user = *user_nodes.at(late);
  user.late = true;
  publications.users[late] = {};
  order.stalled_users.push_back(late);
  std::vector<Steppable> roles;
  for (auto& [number, other] : user_nodes) {
    if (other->thread == thread && !other->late) {
      other->role->set_thread(parts_of(*replacement));
      order.moved_users.push_back({number, &replacement->worker->bell()});
      roles.push_back(Steppable::of(*other->role));
    }
  }
  user.abandoned = std::exchange(user_threads[thread], std::move(replacement));
  user_threads[thread]->worker->assign(std::move(roles));
}

// The last node was lost within a frame: a role that the server's thread steps takes its slot.
void World::Implementation::fallback() {
  server_worker->assign({Steppable::of(*server)});  // without the bridge: all remote nodes are lost
  const facade::PoolNode& node = pool.replace(order.fallback_slot, server->map());
  server_worker->assign({Steppable::of(*server), Steppable::of(*node.role)});
  order.fallback_id = node.id;
  order.fallback = node.server.first;
  order.fallback_ready.store(true, std::memory_order_release);
  server_bell()->ring();
}

// Called when a frame is complete.
void World::Implementation::remove_gone_nodes() {
  std::vector<NodeNumber> gone;
  pool.each([&](const facade::PoolNode& node) {
    if (is_lost(node.id) || server->has_left(node.slot)) {
      gone.push_back(node.slot);
    }
  });
  if (gone.empty() && report.lost.empty()) {
    return;
  }
  const auto before = static_cast<std::uint32_t>(pool.size());
  if (threaded()) {
    server_worker->assign({});
  }
  pool.remove(gone);
  const auto left = static_cast<std::uint32_t>(pool.size());
  if (!report.lost.empty() && resize_to == 0 && config.remote_nodes == nullptr && server->has_abandoned_nodes()) {
    resize_to = before;
  } else if (!report.lost.empty() && resize_to == 0 && resizing_to < left) {
    resize_to = resizing_to;  // in the frame of a loss no node leaves
  }
  if (left == 0) {
    requests.insert(requests.begin(), join_request(pool.add(server->map(), 1, false)));
  }
  connect_pool();
}

void World::Implementation::log_losses() const {
  const std::string frame = " in frame " + std::to_string(report.frame);
  if (server->has_abandoned_nodes()) {
    log(LogLevel::error, "the thread of a lost CD node has stopped while it was reading memory of the others" + frame +
                             ": all CD nodes are lost with it, and new ones replace them");
  }
  for (const NodeId node : report.lost) {
    log(LogLevel::error, "CD node " + std::to_string(node.number()) + " stopped answering" + frame +
                             ": other nodes take over its regions, pairs and objects; " + std::to_string(pool.size()) +
                             " left");
  }
  for (const UserId user : report.late) {
    log(LogLevel::warning, "user node " + std::to_string(user.number()) + " missed its deadline" + frame +
                               ": its objects did not move, and it is disconnected at the next cut");
  }
}

}  // namespace ringfence
