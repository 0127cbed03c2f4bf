// CD nodes of a World: connections, joining and leaving.
#include <algorithm>
#include <utility>

#include "facade/config_check.hpp"
#include "facade/implementation.hpp"

namespace ringfence {

using facade::DuplexChannel;
using facade::PoolChannel;
using facade::PoolNode;
using facade::remote_node_ring;
using facade::server_node_ring;
using facade::Steppable;
using nodes::Request;

namespace {

PoolChannel pool_channel(const std::shared_ptr<DuplexChannel>& channel) {
  return {channel->first(), channel->second(), channel};
}

// With many nodes there are many rings between them, and hand-overs are small.
std::size_t node_node_ring(std::size_t nodes) noexcept {
  return std::size_t{1} << (nodes <= 16 ? 18 : nodes <= 64 ? 14 : 12);
}

}  // namespace

facade::NodePoolSetup World::Implementation::pool_setup() {
  facade::NodePoolSetup setup;
  setup.role.shapes = &shapes;
  setup.role.space = &space;
  setup.role.model = config.motion.get();
  setup.role.placement = config.placement;
  setup.role.layer_masks = layer_masks;
  setup.role.keep_resting = config.tuning.keep_resting;
  setup.role.hosts = config.deployment == Deployment::user_collision;
  setup.role.remember_axes = config.tuning.remember_axes;
  setup.role.may_be_lost = threaded() && config.deadlines.node_ms > 0;
  setup.role.interest_grid = publications.grid;
  setup.objects = config.capacities.objects;
  setup.pairs = config.capacities.pairs;
  setup.faults = &faults;
  setup.timeline = config.timeline;
  setup.needs_publications = config.interest > 0;
  setup.connect_to_server = [this](const PoolNode& node, std::size_t count) { return connect_to_server(node, count); };
  setup.connect = [this](const PoolNode& first, const PoolNode& second, std::size_t count) {
    return connect_nodes(first, second, count);
  };
  setup.start_worker = [this](facade::Worker& worker) { return start_worker(worker); };
  return setup;
}

link::Doorbell* World::Implementation::bell_of(const PoolNode& node) noexcept {
  return node.worker != nullptr ? &node.worker->bell() : server_bell();
}

// If all nodes are in this process, also the memory that the node shares with the others, as one of `count` nodes.
PoolChannel World::Implementation::connect_to_server(const PoolNode& node, std::size_t count) {
  const bool here = node.member == RemoteNodes::local_member;
  auto channel = std::make_shared<DuplexChannel>(here ? ring_bytes(server_node_ring) : remote_node_ring, server_bell(),
                                                 bell_of(node));
  const bool shares = config.remote_nodes == nullptr;
  if (shares) {
    channel->node_contacts = std::make_unique<nodes::NodeContacts>();
  }
  if (shares && config.deployment == Deployment::user_collision && config.interest > 0) {
    channel->publication = std::make_unique<nodes::NodePublication>(
        publications.grid, facade::NodePool::share_of(config.capacities.objects, count));
  }
  return pool_channel(channel);
}

PoolChannel World::Implementation::connect_nodes(const PoolNode& first, const PoolNode& second, std::size_t count) {
  return pool_channel(std::make_shared<DuplexChannel>(
      config.remote_nodes != nullptr ? remote_node_ring : ring_bytes(node_node_ring(count)), bell_of(first),
      bell_of(second)));
}

// Connects the nodes with each other and starts to step them.
void World::Implementation::connect_pool() {
  if (threaded() && server != nullptr) {
    server_worker->assign({});
  }
  pool.connect();
  assign_remote_nodes();
  if (threaded()) {
    server_worker->assign(server_thread_roles());
  }
  list_inline_roles();
}

// The roles that the server's thread steps: the server, nodes without a thread of their own, then the bridge to remote
// nodes.
std::vector<Steppable> World::Implementation::server_thread_roles() {
  std::vector<Steppable> roles{Steppable::of(*server)};
  pool.each([&](PoolNode& node) {
    if (node.role != nullptr && node.worker == nullptr) {
      roles.push_back(Steppable::of(*node.role));
    }
  });
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
  std::vector<RemoteNodes::NodeAssignment> assignments(pool.slots());
  pool.each([&](const PoolNode& node) {
    RemoteNodes::NodeAssignment& assignment = assignments[node.slot];
    assignment.id = node.id;
    assignment.objects = facade::NodePool::share_of(config.capacities.objects, pool.size());
    assignment.pairs = facade::NodePool::share_of(config.capacities.pairs, pool.size());
    assignment.member = node.member;
    if (assignment.member != RemoteNodes::local_member) {
      assignment.server = node.server.second;
      assignment.peers = pool.peers_of(node);
    }
  });
  config.remote_nodes->assign(*server, assignments, server->map());
}

Request World::Implementation::join_request(const PoolNode& node) const {
  Request request;
  request.kind = Request::Kind::add_node;
  request.node = node.slot;
  request.node_id = node.id;
  request.connection = node.server.first;
  return request;
}

// The nodes in the slots leave, and all cells are divided again among the others.
void World::Implementation::request_partition(std::span<const NodeNumber> leavers) {
  Request request;
  request.kind = Request::Kind::retire_node;
  for (const NodeNumber slot : leavers) {
    request.node = slot;
    order.requests.push_back(request);
  }
  request.kind = Request::Kind::partition;
  order.requests.push_back(request);
}

// Adds remote nodes that are ready and starts the departure of those that want to leave. If all leave, a role stepped
// by the server's thread takes over; it leaves in turn when remote nodes have joined.
void World::Implementation::add_arrivals() {
  const auto arrivals = config.remote_nodes->arrivals();
  std::vector<NodeNumber> leavers;
  if (resizing_to != 0) {
    leavers = pool.youngest(pool.size() - std::min<std::size_t>(pool.size(), resizing_to));
  }
  const auto is_remote = [](const PoolNode& node) { return node.member != RemoteNodes::local_member; };
  bool remote_nodes_stay = !arrivals.empty();
  pool.each([&](const PoolNode& node) {
    remote_nodes_stay |= is_remote(node) && !config.remote_nodes->is_leaving(node.member);
  });
  pool.each([&](const PoolNode& node) {
    const bool leaves = is_remote(node) ? config.remote_nodes->is_leaving(node.member) : remote_nodes_stay;
    if (leaves && std::find(leavers.begin(), leavers.end(), node.slot) == leavers.end()) {
      leavers.push_back(node.slot);
    }
  });
  // Further nodes wait until there is a free cell.
  const std::size_t cells = server->map().grid().cells();
  const std::size_t staying = pool.size() - leavers.size();
  const std::size_t room = std::min(cells - std::min(cells, staying), facade::max_nodes - pool.size());
  std::vector<RemoteNodes::MemberId> joining(
      arrivals.begin(), arrivals.begin() + static_cast<std::ptrdiff_t>(std::min(arrivals.size(), room)));
  if (joining.empty() && leavers.empty()) {
    return;
  }
  if (joining.empty() && staying == 0) {
    if (room == 0) {
      return;  // no other node can take over in this frame, so all nodes stay
    }
    joining.push_back(RemoteNodes::local_member);
  }
  const std::size_t total = pool.size() + joining.size();
  for (const RemoteNodes::MemberId member : joining) {
    order.requests.push_back(join_request(pool.add(server->map(), total, false, member)));
  }
  if (!joining.empty()) {
    connect_pool();
  }
  request_partition(leavers);
}

// Creates the threads that are missing for `count` nodes. If one cannot be created, none is, and the log says what to
// do.
bool World::Implementation::prepare_nodes(std::uint32_t count) {
  if (pool.prepare_threads(count)) {
    return true;
  }
  log(LogLevel::error, "the system has no thread for one of " + std::to_string(count) +
                           " CD nodes: the number of nodes stays " + std::to_string(pool.size()) +
                           "; resize to fewer, or raise the limit on threads (ulimit -u, pids.max) and resize again");
  return false;
}

// Precondition: no frame is running.
void World::Implementation::resize_nodes() {
  resizing_to = std::exchange(resize_to, 0u);
  if (config.remote_nodes != nullptr) {
    return add_arrivals();
  }
  if (resizing_to == 0) {
    return;
  }
  // resize() has created the threads, but more are missing if nodes were lost since then.
  if (threaded() && !prepare_nodes(resizing_to)) {
    (void)refuse(Status::no_thread);  // counted; resize() has returned
    resizing_to = 0;
    return;
  }
  const std::vector<NodeNumber> leavers = pool.youngest(pool.size() - std::min<std::size_t>(pool.size(), resizing_to));
  const bool more = resizing_to > pool.size();
  while (pool.size() < resizing_to) {
    order.requests.push_back(join_request(pool.add(server->map(), resizing_to, threaded())));
  }
  if (more) {
    connect_pool();
  }
  request_partition(leavers);
}

}  // namespace ringfence
