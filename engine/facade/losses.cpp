// Lost CD nodes, and the fallback node that replaces the last one.
#include <algorithm>
#include <string>
#include <utility>

#include "facade/implementation.hpp"

namespace ringfence {

using facade::DuplexChannel;
using facade::RetiredNode;
using facade::Steppable;
using nodes::Connection;
using nodes::Request;

void World::Implementation::await_frame() {
  for (;;) {
    caller_bell.wait([&] {
      return order.completed.load(std::memory_order_acquire) == begun ||
             order.fallback_wanted.load(std::memory_order_acquire);
    });
    if (!order.fallback_wanted.exchange(false, std::memory_order_acquire)) {
      return;
    }
    fallback();
  }
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
  if (node_workers[node] != nullptr) {
    node_workers[node]->dismiss();
  }
  retired_nodes.push_back({std::move(node_channels[node]), std::move(node_roles[node]), std::move(node_workers[node])});
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
    const bool gone = std::find(report.lost.begin(), report.lost.end(), node) != report.lost.end();
    if ((gone && node != fallback_number) || server->has_left(node)) {
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
  decltype(peer_channels) left;
  for (auto& [ends, channel] : peer_channels) {
    const auto is_lost = [&](NodeNumber node) { return std::find(lost.begin(), lost.end(), node) != lost.end(); };
    const auto number = [&](NodeNumber node) {
      const auto below = std::count_if(lost.begin(), lost.end(), [&](NodeNumber other) { return other < node; });
      return node - static_cast<NodeNumber>(below);
    };
    if (is_lost(ends.first) || is_lost(ends.second)) {
      retired_channels.push_back(std::move(channel));
    } else {
      left[{number(ends.first), number(ends.second)}] = std::move(channel);
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
    node_members.erase(node_members.begin() + at);
  }
  if (node_roles.empty()) {
    node_workers.push_back(nullptr);
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
  for (const NodeNumber node : report.lost) {
    log(LogLevel::error, "CD node " + std::to_string(node) + " stopped answering" + frame +
                             ": other nodes take over its regions, pairs and objects; " +
                             std::to_string(node_roles.size()) + " left");
  }
  for (const UserNumber user : report.late) {
    log(LogLevel::warning, "user node " + std::to_string(user) + " missed its deadline" + frame +
                               ": its objects did not move, and it is disconnected at the next cut");
  }
}

}  // namespace ringfence
