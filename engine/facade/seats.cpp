// CD nodes: made, told of each other, joined and let go.
#include <algorithm>
#include <iterator>
#include <utility>

#include "facade/config_check.hpp"
#include "facade/implementation.hpp"

namespace ringfence {

using facade::fleet_ring;
using facade::server_node_ring;
using facade::Steppable;
using facade::Way;
using facade::Worker;
using nodes::Line;
using nodes::Request;

namespace {

// What one of `count` nodes reserves: twice its even share.
std::size_t share_of(std::size_t capacity, std::size_t count) noexcept {
  return std::min(capacity, 2 * capacity / count + 64);
}

}  // namespace

// Makes the next CD node of `count` in the end, not yet introduced to its peers and not yet stepped; returns the
// server's end of its line. Of a fleet's member only the lines are made: its role is elsewhere.
Line World::Implementation::add_node(const regions::RegionMap& map, std::uint32_t count, Fleet::Member member) {
  const auto node = static_cast<NodeNumber>(node_roles.size());
  const bool here = member == Fleet::nobody;
  node_workers.emplace_back();
  if (here && threaded() && config.fleet == nullptr) {
    node_workers.back() = std::make_unique<Worker>();
    start_worker(*node_workers.back());
  }
  node_members.push_back(member);
  link::Doorbell* bell = node_bell(node);
  node_ways.push_back(std::make_unique<Way>(here ? ring_bytes(server_node_ring) : fleet_ring, server_bell(), bell));
  if (here) {
    share_memory(*node_ways.back(), count);
  }
  // Many nodes need many rings between them; a hand-over is small.
  const std::size_t peer_ring = config.fleet != nullptr ? fleet_ring
                                                        : ring_bytes(std::size_t{1} << (count <= 16   ? 18
                                                                                        : count <= 64 ? 14
                                                                                                      : 12));
  for (NodeNumber peer = 0; peer < node; ++peer) {
    if (here || node_members[peer] == Fleet::nobody) {
      peer_ways[{peer, node}] = std::make_unique<Way>(peer_ring, node_bell(peer), bell);
    }
  }
  if (here) {
    node_roles.push_back(make_role(node, count, map));
  } else {
    node_roles.emplace_back();
    if (config.timeline) {
      node_tracks.emplace_back();  // keeps the tracks of others in their places
    }
  }
  return node_ways.back()->first();
}

// What the server and a CD node of this process, one of `count`, have in common.
void World::Implementation::share_memory(Way& way, std::uint32_t count) {
  way.findings = std::make_unique<nodes::Findings>();
  if (config.deployment == Deployment::user_collision && config.interest > 0) {
    way.publication =
        std::make_unique<nodes::NodePublication>(publications.grid, share_of(config.capacities.objects, count));
  }
}

link::Doorbell* World::Implementation::node_bell(NodeNumber node) noexcept {
  return threaded() && node_workers[node] != nullptr ? &node_workers[node]->bell() : server_bell();
}

// The role of node number `node`, whose way to the server is there, of `count` in the end.
std::unique_ptr<nodes::CdNodeRole> World::Implementation::make_role(NodeNumber node, std::uint32_t count,
                                                                    const regions::RegionMap& map) {
  nodes::CdNodeSetup setup;
  setup.node = node;
  setup.shapes = &shapes;
  setup.space = &space;
  setup.model = config.motion.get();
  setup.placement = config.placement;
  setup.layer_masks = layer_masks;
  setup.keep_resting = config.keep_resting;
  setup.hosts = config.deployment == Deployment::user_collision;
  setup.shares_thread = !threaded() || node_workers[node] == nullptr;
  setup.track = config.timeline ? &node_tracks.emplace_back() : nullptr;
  setup.remember_axes = config.remember_axes;
  setup.may_be_lost = threaded() && config.deadlines.node_ms > 0;
  // Else the server relays them to the users.
  setup.keeps_states = config.interest <= 0 || node_ways[node]->publication != nullptr;
  setup.interest_grid = publications.grid;
  setup.objects = share_of(config.capacities.objects, count);
  setup.pairs = share_of(config.capacities.pairs, count);
  setup.server = node_ways[node]->second();
  return std::make_unique<nodes::CdNodeRole>(setup, map);
}

// Tells every node of the others and lets the threads step them.
void World::Implementation::introduce_nodes() {
  const auto count = static_cast<NodeNumber>(node_roles.size());
  if (threaded() && server != nullptr) {
    server_worker->assign({});
  }
  for (NodeNumber node = 0; node < count; ++node) {
    if (node_roles[node] == nullptr) {
      continue;
    }
    Worker* worker = threaded() ? node_workers[node].get() : nullptr;
    if (worker != nullptr) {
      worker->assign({});
    }
    node_roles[node]->meet(node, peers_of(node));
    if (worker != nullptr) {
      worker->assign({Steppable::of(*node_roles[node])});
    }
  }
  seat_fleet();
  if (threaded()) {
    server_worker->assign(server_crew());
  }
  list_in_place();
}

// The lines of a node to its peers, by their numbers; empty where this process has none.
std::vector<Line> World::Implementation::peers_of(NodeNumber node) {
  std::vector<Line> peers(node_roles.size());
  for (NodeNumber peer = 0; peer < peers.size(); ++peer) {
    const auto way = peer_ways.find({std::min(peer, node), std::max(peer, node)});
    if (way != peer_ways.end()) {
      peers[peer] = node < peer ? way->second->first() : way->second->second();
      peers[peer].findings = node_ways[peer]->findings.get();
    }
  }
  return peers;
}

// What the server's thread steps: the server, nodes without a thread of their own, and then what carries to the others.
std::vector<Steppable> World::Implementation::server_crew() {
  std::vector<Steppable> crew{Steppable::of(*server)};
  for (std::size_t node = 0; node < node_roles.size(); ++node) {
    if (node_roles[node] != nullptr && node_workers[node] == nullptr) {
      crew.push_back(Steppable::of(*node_roles[node]));
    }
  }
  if (config.fleet != nullptr) {
    crew.push_back(config.fleet->bridge());
  }
  return crew;
}

// No thread steps the bridge.
void World::Implementation::seat_fleet() {
  if (config.fleet == nullptr) {
    return;
  }
  std::vector<Fleet::Seat> seats(node_roles.size());
  for (NodeNumber node = 0; node < seats.size(); ++node) {
    Fleet::Seat& seat = seats[node];
    seat.objects = share_of(config.capacities.objects, seats.size());
    seat.pairs = share_of(config.capacities.pairs, seats.size());
    seat.member = node_members[node];
    if (seat.member != Fleet::nobody) {
      seat.server = node_ways[node]->second();
      seat.peers = peers_of(node);
    }
  }
  config.fleet->seat(*server, seats, server->map());
}

// Takes in the members of the fleet that are ready, and lets those hand over that want to leave. Where those are all,
// a role that the server's thread steps takes their place; it goes in turn when others have come.
void World::Implementation::welcome_arrivals() {
  const std::uint32_t wanted = std::exchange(resize_to, 0u);
  const auto arrivals = config.fleet->arrivals();
  const auto is_leaving = [&](std::size_t node) {
    if (wanted != 0 && node >= wanted) {
      return true;
    }
    const bool member = node_members[node] != Fleet::nobody;
    return member ? config.fleet->is_leaving(node_members[node]) : !arrivals.empty();
  };
  std::vector<NodeNumber> going;
  for (NodeNumber node = 0; node < node_roles.size(); ++node) {
    if (is_leaving(node)) {
      going.push_back(node);
    }
  }
  // More than can have a seat wait until one is free.
  const std::size_t cells = server->map().grid().cells();
  const std::size_t staying = node_roles.size() - going.size();
  const std::size_t room = std::min(cells - std::min(cells, staying), facade::most_nodes - node_roles.size());
  std::vector<Fleet::Member> joining(arrivals.begin(),
                                     arrivals.begin() + static_cast<std::ptrdiff_t>(std::min(arrivals.size(), room)));
  if (joining.empty() && going.empty()) {
    return;
  }
  if (joining.empty() && staying == 0) {
    if (room == 0) {
      return;  // none can take over in this frame, so all stay for it
    }
    joining.push_back(Fleet::nobody);
  }
  const auto total = static_cast<std::uint32_t>(node_roles.size() + joining.size());
  Request request;
  request.kind = Request::Kind::add_node;
  for (const Fleet::Member member : joining) {
    request.line = add_node(server->map(), total, member);
    order.requests.push_back(request);
  }
  if (!joining.empty()) {
    introduce_nodes();
  }
  request.kind = Request::Kind::retire_node;
  for (const NodeNumber node : going) {
    request.nodes = node;
    order.requests.push_back(request);
  }
  request.kind = Request::Kind::resize;
  request.nodes = total - static_cast<std::uint32_t>(going.size());
  order.requests.push_back(request);
}

// No frame is under way.
void World::Implementation::grow_nodes() {
  if (config.fleet != nullptr) {
    welcome_arrivals();
  }
  if (resize_to == 0) {
    return;
  }
  Request request;
  request.kind = Request::Kind::add_node;
  const bool more = resize_to > node_roles.size();
  while (node_roles.size() < resize_to) {
    request.line = add_node(server->map(), resize_to);
    order.requests.push_back(request);
  }
  if (more) {
    introduce_nodes();
  }
  request.kind = Request::Kind::resize;
  request.nodes = std::exchange(resize_to, 0u);
  order.requests.push_back(request);
}

// The frame in which they handed everything over is complete.
void World::Implementation::retire_nodes() {
  // Lost ones, and those that have left, are out of `node_roles` and not yet out of the map.
  const FrameReport& last = server->report(frames - 1);
  const NodeNumber in_map = server->map().nodes();
  std::size_t count = 0;
  for (NodeNumber node = 0; node < in_map; ++node) {
    const bool lost = std::find(last.lost.begin(), last.lost.end(), node) != last.lost.end();
    count += (!lost || node == stood_in) && !server->has_left(node) ? 1 : 0;
  }
  // Where all that are in the map are lost, the server keeps the first of the others.
  count = std::max<std::size_t>(count, 1);
  if (node_roles.size() <= count) {
    return;
  }
  std::vector<std::unique_ptr<Way>> retired;  // until the others have forgotten the way
  const bool haunted = !graves.empty();       // a lost node's thread may still ring the bells of those that go
  while (node_roles.size() > count) {
    const auto node = static_cast<NodeNumber>(node_roles.size() - 1);
    if (threaded() && node_workers[node] != nullptr) {
      node_workers[node]->assign({});
    } else if (threaded()) {
      server_worker->assign({Steppable::of(*server)});
    }
    for (NodeNumber peer = 0; peer < node; ++peer) {
      retired.push_back(std::move(peer_ways[{peer, node}]));
      peer_ways.erase({peer, node});
    }
    if (haunted) {
      bury(node);
      node_workers.pop_back();
    } else {
      keep_published(*node_ways.back());
      retired.push_back(std::move(node_ways.back()));
    }
    node_ways.pop_back();
    node_roles.pop_back();
    node_members.pop_back();
    if (config.timeline && node_tracks.size() == node_roles.size() + 1) {
      node_tracks.pop_back();
    }
  }
  introduce_nodes();
  if (haunted) {
    grave_ways.insert(grave_ways.end(), std::make_move_iterator(retired.begin()),
                      std::make_move_iterator(retired.end()));
  }
  retired.clear();
  while (node_workers.size() > count) {
    node_workers.pop_back();
  }
}

}  // namespace ringfence
