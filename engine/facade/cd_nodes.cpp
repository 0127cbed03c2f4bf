// CD nodes of a World: creation, connections, joining and leaving.
#include <algorithm>
#include <iterator>
#include <utility>

#include "facade/config_check.hpp"
#include "facade/implementation.hpp"

namespace ringfence {

using facade::DuplexChannel;
using facade::remote_node_ring;
using facade::server_node_ring;
using facade::Steppable;
using facade::Worker;
using nodes::Connection;
using nodes::Request;

namespace {

// Reservation of one of `count` nodes: twice its even share.
std::size_t share_of(std::size_t capacity, std::size_t count) noexcept {
  return std::min(capacity, 2 * capacity / count + 64);
}

}  // namespace

// Creates the next CD node; `count` is the final number of nodes. It has no connections to its peers yet, and no thread
// steps it. Returns the server's end of its connection. For a remote node only the channels are made; its role runs in
// its own process.
Connection World::Implementation::add_node(const regions::RegionMap& map, std::uint32_t count,
                                           RemoteNodes::MemberId member) {
  const auto node = static_cast<NodeNumber>(node_roles.size());
  const bool here = member == RemoteNodes::local_member;
  node_workers.emplace_back();
  node_tracks.emplace_back();
  if (here && threaded() && config.remote_nodes == nullptr) {
    if (!next_workers.empty()) {
      node_workers.back() = std::move(next_workers.back());
      next_workers.pop_back();
    } else {
      node_workers.back() = std::make_unique<Worker>();
      must_start(*node_workers.back());  // in the constructor
    }
  }
  node_members.push_back(member);
  link::Doorbell* bell = node_bell(node);
  node_channels.push_back(
      std::make_unique<DuplexChannel>(here ? ring_bytes(server_node_ring) : remote_node_ring, server_bell(), bell));
  if (here) {
    share_memory(*node_channels.back(), count);
  }
  // With many nodes there are many rings between them, and hand-overs are small.
  const std::size_t peer_ring = config.remote_nodes != nullptr ? remote_node_ring
                                                               : ring_bytes(std::size_t{1} << (count <= 16   ? 18
                                                                                               : count <= 64 ? 14
                                                                                                             : 12));
  for (NodeNumber peer = 0; peer < node; ++peer) {
    if (here || node_members[peer] == RemoteNodes::local_member) {
      peer_channels[{peer, node}] = std::make_unique<DuplexChannel>(peer_ring, node_bell(peer), bell);
    }
  }
  if (here) {
    node_roles.push_back(make_role(node, count, map));
  } else {
    node_roles.emplace_back();
  }
  return node_channels.back()->first();
}

// Creates the memory that the server shares with a CD node of this process, one of `count`.
void World::Implementation::share_memory(DuplexChannel& channel, std::uint32_t count) {
  channel.node_contacts = std::make_unique<nodes::NodeContacts>();
  if (config.deployment == Deployment::user_collision && config.interest > 0) {
    channel.publication =
        std::make_unique<nodes::NodePublication>(publications.grid, share_of(config.capacities.objects, count));
  }
}

link::Doorbell* World::Implementation::node_bell(NodeNumber node) noexcept {
  return threaded() && node_workers[node] != nullptr ? &node_workers[node]->bell() : server_bell();
}

// Creates the role of node `node`, whose channel to the server exists; `count` is the final number of nodes.
std::unique_ptr<nodes::CdNodeRole> World::Implementation::make_role(NodeNumber node, std::uint32_t count,
                                                                    const regions::RegionMap& map) {
  nodes::CdNodeSetup setup;
  setup.node = node;
  setup.shapes = &shapes;
  setup.space = &space;
  setup.model = config.motion.get();
  setup.placement = config.placement;
  setup.layer_masks = layer_masks;
  setup.keep_resting = config.tuning.keep_resting;
  setup.hosts = config.deployment == Deployment::user_collision;
  setup.shares_thread = !threaded() || node_workers[node] == nullptr;
  node_tracks[node] = config.timeline ? std::make_unique<telemetry::Track>() : nullptr;
  setup.track = node_tracks[node].get();
  setup.remember_axes = config.tuning.remember_axes;
  setup.may_be_lost = threaded() && config.deadlines.node_ms > 0;
  // Without a publication the server publishes the states for the users.
  setup.keeps_host_owned_states = config.interest <= 0 || node_channels[node]->publication != nullptr;
  setup.interest_grid = publications.grid;
  setup.objects = share_of(config.capacities.objects, count);
  setup.pairs = share_of(config.capacities.pairs, count);
  setup.faults = threaded() && node_workers[node] != nullptr ? &faults : nullptr;
  setup.server = node_channels[node]->second();
  return std::make_unique<nodes::CdNodeRole>(setup, map);
}

// Gives every node its connections to the others and starts to step it.
void World::Implementation::connect_peers() {
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
    node_roles[node]->assign(node, peers_of(node));
    if (worker != nullptr) {
      worker->assign({Steppable::of(*node_roles[node])});
    }
  }
  assign_remote_nodes();
  if (threaded()) {
    server_worker->assign(server_thread_roles());
  }
  list_inline_roles();
}

// The connections of a node to its peers, by their numbers; empty entries where this process has none.
std::vector<Connection> World::Implementation::peers_of(NodeNumber node) {
  std::vector<Connection> peers(node_roles.size());
  for (NodeNumber peer = 0; peer < peers.size(); ++peer) {
    const auto channel = peer_channels.find({std::min(peer, node), std::max(peer, node)});
    if (channel != peer_channels.end()) {
      peers[peer] = node < peer ? channel->second->first() : channel->second->second();
      peers[peer].node_contacts = node_channels[peer]->node_contacts.get();
    }
  }
  return peers;
}

// The roles that the server's thread steps: the server, nodes without a thread of their own, then the bridge to remote
// nodes.
std::vector<Steppable> World::Implementation::server_thread_roles() {
  std::vector<Steppable> roles{Steppable::of(*server)};
  for (std::size_t node = 0; node < node_roles.size(); ++node) {
    if (node_roles[node] != nullptr && node_workers[node] == nullptr) {
      roles.push_back(Steppable::of(*node_roles[node]));
    }
  }
  if (config.remote_nodes != nullptr) {
    roles.push_back(config.remote_nodes->bridge());
  }
  return roles;
}

// Precondition: no thread steps the bridge.
void World::Implementation::assign_remote_nodes() {
  if (config.remote_nodes == nullptr) {
    return;
  }
  std::vector<RemoteNodes::NodeAssignment> assignments(node_roles.size());
  for (NodeNumber node = 0; node < assignments.size(); ++node) {
    RemoteNodes::NodeAssignment& assignment = assignments[node];
    assignment.objects = share_of(config.capacities.objects, assignments.size());
    assignment.pairs = share_of(config.capacities.pairs, assignments.size());
    assignment.member = node_members[node];
    if (assignment.member != RemoteNodes::local_member) {
      assignment.server = node_channels[node]->second();
      assignment.peers = peers_of(node);
    }
  }
  config.remote_nodes->assign(*server, assignments, server->map());
}

// Adds remote nodes that are ready and starts the departure of those that want to leave. If all leave, a role stepped
// by the server's thread takes over; it leaves in turn when remote nodes have joined.
void World::Implementation::add_arrivals() {
  const std::uint32_t wanted = std::exchange(resize_to, 0u);
  const auto arrivals = config.remote_nodes->arrivals();
  const auto is_leaving = [&](std::size_t node) {
    if (wanted != 0 && node >= wanted) {
      return true;
    }
    const bool member = node_members[node] != RemoteNodes::local_member;
    return member ? config.remote_nodes->is_leaving(node_members[node]) : !arrivals.empty();
  };
  std::vector<NodeNumber> going;
  for (NodeNumber node = 0; node < node_roles.size(); ++node) {
    if (is_leaving(node)) {
      going.push_back(node);
    }
  }
  // Further nodes wait until there is a free cell.
  const std::size_t cells = server->map().grid().cells();
  const std::size_t staying = node_roles.size() - going.size();
  const std::size_t room = std::min(cells - std::min(cells, staying), facade::max_nodes - node_roles.size());
  std::vector<RemoteNodes::MemberId> joining(
      arrivals.begin(), arrivals.begin() + static_cast<std::ptrdiff_t>(std::min(arrivals.size(), room)));
  if (joining.empty() && going.empty()) {
    return;
  }
  if (joining.empty() && staying == 0) {
    if (room == 0) {
      return;  // no other node can take over in this frame, so all nodes stay
    }
    joining.push_back(RemoteNodes::local_member);
  }
  const auto total = static_cast<std::uint32_t>(node_roles.size() + joining.size());
  Request request;
  request.kind = Request::Kind::add_node;
  for (const RemoteNodes::MemberId member : joining) {
    request.connection = add_node(server->map(), total, member);
    order.requests.push_back(request);
  }
  if (!joining.empty()) {
    connect_peers();
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

// Creates the threads that are missing for `count` nodes. If one cannot be created, none is, and the log says what to
// do.
bool World::Implementation::prepare_nodes(std::uint32_t count) {
  const std::size_t missing = count - std::min<std::size_t>(count, node_roles.size());
  next_workers.reserve(missing);
  while (next_workers.size() > missing) {
    next_workers.pop_back();
  }
  while (next_workers.size() < missing) {
    auto worker = std::make_unique<Worker>();
    if (!start_worker(*worker)) {
      next_workers.clear();
      log(LogLevel::error,
          "the system has no thread for one of " + std::to_string(count) + " CD nodes: the number of nodes stays " +
              std::to_string(node_roles.size()) +
              "; resize to fewer, or raise the limit on threads (ulimit -u, pids.max) and resize again");
      return false;
    }
    next_workers.push_back(std::move(worker));
  }
  return true;
}

// Precondition: no frame is running.
void World::Implementation::grow_nodes() {
  if (config.remote_nodes != nullptr) {
    add_arrivals();
  }
  if (resize_to == 0) {
    return;
  }
  // resize() has created the threads, but more are missing if nodes were lost since then.
  if (threaded() && !prepare_nodes(resize_to)) {
    (void)refuse(Status::no_thread);  // counted; resize() has returned
    resize_to = 0;
    return;
  }
  Request request;
  request.kind = Request::Kind::add_node;
  const bool more = resize_to > node_roles.size();
  while (node_roles.size() < resize_to) {
    request.connection = add_node(server->map(), resize_to);
    order.requests.push_back(request);
  }
  if (more) {
    connect_peers();
  }
  request.kind = Request::Kind::resize;
  request.nodes = std::exchange(resize_to, 0u);
  order.requests.push_back(request);
}

// Precondition: the frame in which the nodes handed everything over is complete.
void World::Implementation::retire_nodes() {
  // Lost nodes and nodes that have left are no longer in `node_roles`, but still in the map.
  const FrameReport& last = server->report(frames - 1);
  const NodeNumber in_map = server->map().nodes();
  std::size_t count = 0;
  for (NodeNumber node = 0; node < in_map; ++node) {
    const bool lost = std::find(last.lost.begin(), last.lost.end(), NodeId(node)) != last.lost.end();
    count += (!lost || node == fallback_number) && !server->has_left(node) ? 1 : 0;
  }
  // If all nodes of the map are lost, the server keeps the first of the others.
  count = std::max<std::size_t>(count, 1);
  if (node_roles.size() <= count) {
    return;
  }
  // Freed after the other nodes have dropped these channels.
  std::vector<std::unique_ptr<DuplexChannel>> removed_channels;
  // The thread of a lost node may still ring the bells of nodes that leave.
  const bool has_live_retirees = !retired_nodes.empty();
  while (node_roles.size() > count) {
    const auto node = static_cast<NodeNumber>(node_roles.size() - 1);
    if (threaded() && node_workers[node] != nullptr) {
      node_workers[node]->assign({});
    } else if (threaded()) {
      server_worker->assign({Steppable::of(*server)});
    }
    for (NodeNumber peer = 0; peer < node; ++peer) {
      removed_channels.push_back(std::move(peer_channels[{peer, node}]));
      peer_channels.erase({peer, node});
    }
    if (has_live_retirees) {
      retire(node);
      node_workers.pop_back();
    } else {
      keep_publication(*node_channels.back());
      removed_channels.push_back(std::move(node_channels.back()));
    }
    node_channels.pop_back();
    node_roles.pop_back();
    node_members.pop_back();
    node_tracks.pop_back();
  }
  connect_peers();
  if (has_live_retirees) {
    retired_channels.insert(retired_channels.end(), std::make_move_iterator(removed_channels.begin()),
                            std::make_move_iterator(removed_channels.end()));
  }
  removed_channels.clear();
  while (node_workers.size() > count) {
    node_workers.pop_back();
  }
}

}  // namespace ringfence
