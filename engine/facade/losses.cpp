// Lost CD nodes, and the fallback node that replaces the last one.
#include <algorithm>
#include <exception>
#include <string>
#include <utility>

#include "facade/implementation.hpp"

namespace ringfence {

using facade::DuplexChannel;
using facade::RetiredNode;
using facade::Steppable;
using facade::User;
using facade::UserThread;
using nodes::Connection;
using nodes::Request;

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

// The last node was lost within a frame: creates a role with the same number, stepped by the server's thread.
void World::Implementation::fallback() {
  const NodeNumber node = order.fallback_for;
  server_worker->assign({Steppable::of(*server)});  // without the bridge: all remote nodes are lost
  retire(node);
  const auto count = static_cast<std::uint32_t>(node_roles.size());
  node_channels[node] =
      std::make_unique<DuplexChannel>(ring_bytes(facade::server_node_ring), server_bell(), server_bell());
  share_memory(*node_channels[node], count);
  node_roles[node] = make_role(node, count, server->map());
  node_roles[node]->assign(node, std::vector<Connection>(count));
  node_members[node] = RemoteNodes::local_member;
  server_worker->assign({Steppable::of(*server), Steppable::of(*node_roles[node])});
  fallback_number = node;
  order.fallback = node_channels[node]->first();
  order.fallback_ready.store(true, std::memory_order_release);
  server_bell()->ring();
}

void World::Implementation::retire(NodeNumber node) {
  retired_nodes.reserve(retired_nodes.size() + 1);  // so that nothing throws after the thread is dismissed
  if (node_workers[node] != nullptr) {
    node_workers[node]->dismiss();
  }
  retired_nodes.push_back({std::move(node_channels[node]), std::move(node_tracks[node]), std::move(node_roles[node]),
                           std::move(node_workers[node])});
}

// Frees retired nodes when all their threads have ended: until then one may still write to a channel of another.
void World::Implementation::free_retired_nodes() {
  const auto is_quiet = [](const RetiredNode& retired_node) {
    return retired_node.worker == nullptr || retired_node.worker->has_ended();
  };
  if (!retired_nodes.empty() && std::all_of(retired_nodes.begin(), retired_nodes.end(), is_quiet)) {
    for (RetiredNode& retired_node : retired_nodes) {
      retired_node.worker.reset();
      keep_publication(*retired_node.channel);
    }
    retired_nodes.clear();
    retired_channels.clear();
    server->free_abandoned();
  }
}

void World::Implementation::keep_publication(DuplexChannel& channel) {
  if (channel.publication != nullptr) {
    departed_publications.push_back(std::move(channel.publication));
  }
}

// Called when a frame is complete. Renumbers the remaining nodes in order, as the server does at its next cut.
void World::Implementation::retire_lost_nodes() {
  std::vector<NodeNumber> lost;
  for (NodeNumber node = 0; node < node_roles.size(); ++node) {
    if (is_lost(node) || server->has_left(node)) {
      lost.push_back(node);
    }
  }
  if (lost.empty()) {
    if (fallback_number && config.remote_nodes != nullptr) {
      connect_peers();  // the last remote node is lost
    }
    return;
  }
  std::sort(lost.rbegin(), lost.rend());
  // Nothing is allocated while channels are moved: a channel must outlive the threads that may use it.
  retired_channels.reserve(retired_channels.size() + peer_channels.size());
  decltype(peer_channels) left;
  while (!peer_channels.empty()) {
    auto entry = peer_channels.extract(peer_channels.begin());
    auto& [first, second] = entry.key();
    const auto is_lost = [&](NodeNumber node) { return std::find(lost.begin(), lost.end(), node) != lost.end(); };
    const auto number = [&](NodeNumber node) {
      const auto below = std::count_if(lost.begin(), lost.end(), [&](NodeNumber other) { return other < node; });
      return node - static_cast<NodeNumber>(below);
    };
    if (is_lost(first) || is_lost(second)) {
      retired_channels.push_back(std::move(entry.mapped()));
    } else {
      entry.key() = {number(first), number(second)};
      left.insert(left.end(), std::move(entry));
    }
  }
  peer_channels = std::move(left);
  for (const NodeNumber node : lost) {
    if (node_workers[node] == nullptr) {
      server_worker->assign({Steppable::of(*server)});
    }
    retire(node);
    const auto at = static_cast<std::ptrdiff_t>(node);
    node_channels.erase(node_channels.begin() + at);
    node_roles.erase(node_roles.begin() + at);
    node_workers.erase(node_workers.begin() + at);
    node_tracks.erase(node_tracks.begin() + at);
    node_members.erase(node_members.begin() + at);
  }
  if (server->has_abandoned_nodes() && config.remote_nodes == nullptr && resize_to == 0) {
    resize_to = static_cast<std::uint32_t>(node_roles.size() + lost.size());
  }
  if (node_roles.empty()) {
    node_workers.push_back(nullptr);
    node_tracks.push_back(nullptr);
    node_members.push_back(RemoteNodes::local_member);
    node_channels.push_back(
        std::make_unique<DuplexChannel>(ring_bytes(facade::server_node_ring), server_bell(), server_bell()));
    share_memory(*node_channels.back(), 1);
    node_roles.push_back(make_role(0, 1, server->map()));
    Request request;
    request.kind = Request::Kind::add_node;
    request.connection = node_channels[0]->first();
    requests.insert(requests.begin(), request);
  }
  connect_peers();
}

void World::Implementation::log_losses() const {
  const std::string frame = " in frame " + std::to_string(report.frame);
  if (server->has_abandoned_nodes()) {
    log(LogLevel::error, "the thread of a lost CD node has stopped while it was reading memory of the others" + frame +
                             ": all CD nodes are lost with it, and new ones replace them");
  }
  for (const NodeId node : report.lost) {
    log(LogLevel::error, "CD node " + std::to_string(node.number()) + " stopped answering" + frame +
                             ": other nodes take over its regions, pairs and objects; " +
                             std::to_string(node_roles.size()) + " left");
  }
  for (const UserId user : report.late) {
    log(LogLevel::warning, "user node " + std::to_string(user.number()) + " missed its deadline" + frame +
                               ": its objects did not move, and it is disconnected at the next cut");
  }
}

}  // namespace ringfence
