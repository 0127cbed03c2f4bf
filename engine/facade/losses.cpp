// Who is no longer there: CD nodes that the server has declared lost, and the one that takes the place of the last.
#include <algorithm>
#include <string>
#include <utility>

#include "facade/implementation.hpp"

namespace ringfence {

using facade::Grave;
using facade::Steppable;
using facade::Way;
using nodes::Line;
using nodes::Request;

void World::Implementation::await_frame() {
  for (;;) {
    caller_bell.wait([&] {
      return order.completed.load(std::memory_order_acquire) == begun ||
             order.stand_in_wanted.load(std::memory_order_acquire);
    });
    if (!order.stand_in_wanted.exchange(false, std::memory_order_acquire)) {
      return;
    }
    stand_in();
  }
}

// The last node is lost within a frame, and the server waits for another: a role of that number that the server's own
// thread steps.
void World::Implementation::stand_in() {
  const NodeNumber node = order.stand_in_for;
  server_worker->assign({Steppable::of(*server)});  // of the fleet all are lost: there is nobody to carry to
  bury(node);
  const auto count = static_cast<std::uint32_t>(node_roles.size());
  node_ways[node] = std::make_unique<Way>(ring_bytes(facade::server_node_ring), server_bell(), server_bell());
  share_memory(*node_ways[node], count);
  node_roles[node] = make_role(node, count, server->map());
  node_roles[node]->meet(node, std::vector<Line>(count));
  node_members[node] = Fleet::nobody;
  server_worker->assign({Steppable::of(*server), Steppable::of(*node_roles[node])});
  stood_in = node;
  order.stand_in = node_ways[node]->first();
  order.stand_in_ready.store(true, std::memory_order_release);
  server_bell()->ring();
}

void World::Implementation::bury(NodeNumber node) {
  if (node_workers[node] != nullptr) {
    node_workers[node]->dismiss();
  }
  graves.push_back({std::move(node_ways[node]), std::move(node_roles[node]), std::move(node_workers[node])});
}

// What lost nodes left is let go once all their threads have ended: until then one may still speak to another.
void World::Implementation::clear_graves() {
  const auto is_quiet = [](const Grave& grave) { return grave.worker == nullptr || grave.worker->has_ended(); };
  if (!graves.empty() && std::all_of(graves.begin(), graves.end(), is_quiet)) {
    for (Grave& grave : graves) {
      grave.worker.reset();
      keep_published(*grave.way);
    }
    graves.clear();
    grave_ways.clear();
  }
}

void World::Implementation::keep_published(Way& way) {
  if (way.publication != nullptr) {
    parted.push_back(std::move(way.publication));
  }
}

// The frame is complete. Those that are neither lost nor have left are numbered anew, in order, as the server does at
// its next cut.
void World::Implementation::bury_lost() {
  std::vector<NodeNumber> lost;
  for (NodeNumber node = 0; node < node_roles.size(); ++node) {
    const bool gone = std::find(report.lost.begin(), report.lost.end(), node) != report.lost.end();
    if ((gone && node != stood_in) || server->has_left(node)) {
      lost.push_back(node);
    }
  }
  if (lost.empty()) {
    if (stood_in && config.fleet != nullptr) {
      introduce_nodes();  // the fleet has lost its last seat
    }
    return;
  }
  std::sort(lost.rbegin(), lost.rend());
  decltype(peer_ways) left;
  for (auto& [ends, way] : peer_ways) {
    const auto is_lost = [&](NodeNumber node) { return std::find(lost.begin(), lost.end(), node) != lost.end(); };
    const auto number = [&](NodeNumber node) {
      const auto below = std::count_if(lost.begin(), lost.end(), [&](NodeNumber other) { return other < node; });
      return node - static_cast<NodeNumber>(below);
    };
    if (is_lost(ends.first) || is_lost(ends.second)) {
      grave_ways.push_back(std::move(way));
    } else {
      left[{number(ends.first), number(ends.second)}] = std::move(way);
    }
  }
  peer_ways = std::move(left);
  for (const NodeNumber node : lost) {
    if (node_workers[node] == nullptr) {
      server_worker->assign({Steppable::of(*server)});
    }
    bury(node);
    const auto at = static_cast<std::ptrdiff_t>(node);
    node_ways.erase(node_ways.begin() + at);
    node_roles.erase(node_roles.begin() + at);
    node_workers.erase(node_workers.begin() + at);
    node_members.erase(node_members.begin() + at);
  }
  if (node_roles.empty()) {
    node_workers.push_back(nullptr);
    node_members.push_back(Fleet::nobody);
    node_ways.push_back(std::make_unique<Way>(ring_bytes(facade::server_node_ring), server_bell(), server_bell()));
    share_memory(*node_ways.back(), 1);
    node_roles.push_back(make_role(0, 1, server->map()));
    Request request;
    request.kind = Request::Kind::add_node;
    request.line = node_ways[0]->first();
    requests.insert(requests.begin(), request);
  }
  introduce_nodes();
}

void World::Implementation::log_losses() const {
  const std::string frame = " in frame " + std::to_string(report.frame);
  for (const NodeNumber node : report.lost) {
    log(LogLevel::error, "CD node " + std::to_string(node) + " stopped answering" + frame +
                             ": the others have its regions, pairs and objects; " + std::to_string(node_roles.size()) +
                             " left");
  }
  for (const UserNumber user : report.late) {
    log(LogLevel::warning, "user node " + std::to_string(user) + " missed its deadline" + frame +
                               ": its objects stood still, and it is disconnected at the next cut");
  }
}

}  // namespace ringfence
