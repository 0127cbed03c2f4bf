#include "facade/cd_nodes/cd_nodes.hpp"

#include <algorithm>
#include <bit>
#include <memory>
#include <utility>

#include "facade/duplex_channel.hpp"

namespace ringfence::facade {

namespace {

/// Default size of a ring between the server and one of `nodes` CD nodes of this process, bytes: its share of 16 MiB.
std::size_t server_node_ring(std::size_t nodes) noexcept {
  constexpr std::size_t largest = std::size_t{1} << 20, smallest = std::size_t{1} << 14;
  return std::clamp(std::bit_floor(16 * largest / std::max<std::size_t>(nodes, 1)), smallest, largest);
}

/// Size of a ring between the server, or a CD node of this process, and a remote node, bytes. It is smaller, so that
/// the network carries the first messages while the server writes the next.
constexpr std::size_t remote_node_ring = std::size_t{1} << 16;

PoolChannel pool_channel(const std::shared_ptr<DuplexChannel>& channel) {
  return {channel->first(), channel->second(), channel};
}

link::Doorbell* bell_of(WorldState& state, const PoolNode& node) noexcept {
  return node.worker != nullptr ? &node.worker->bell() : state.server_bell();
}

// If all nodes are in this process, also the memory that the node shares with the others, as one of `count` nodes.
PoolChannel connect_to_server(WorldState& state, const PoolNode& node, std::size_t count) {
  const WorldConfig& config = state.config;
  const bool here = node.member == RemoteNodes::local_member;
  auto channel = std::make_shared<DuplexChannel>(here ? state.ring_bytes(server_node_ring(count)) : remote_node_ring,
                                                 state.server_bell(), bell_of(state, node));
  const bool shares = state.exchange_kind() == nodes::ExchangeKind::shared;
  if (shares) {
    channel->node_contacts = state.node_contacts.make(count);
    channel->node_contacts->bell = bell_of(state, node);
  }
  if (shares && config.deployment == Deployment::user_collision && config.interest > 0) {
    channel->publication = state.publications_of_nodes.make(count, NodePool::share_of(config.capacities.objects, count),
                                                            config.interest, state.kept_frames());
  }
  return pool_channel(channel);
}

PoolChannel connect_nodes(WorldState& state, const PoolNode& first, const PoolNode& second) {
  return pool_channel(std::make_shared<DuplexChannel>(remote_node_ring, bell_of(state, first), bell_of(state, second)));
}

NodePoolSetup pool_setup(WorldState& state) {
  const WorldConfig& config = state.config;
  NodePoolSetup setup;
  setup.role.shapes = &state.shapes;
  setup.role.space = &state.space;
  setup.role.model = config.motion.get();
  setup.role.sense = config.sense;
  setup.role.placement = config.placement;
  setup.role.exchange = state.exchange_kind();
  setup.role.frame_control = state.frame_control();
  setup.role.layer_masks = state.layer_masks;
  setup.role.keep_resting = config.tuning.keep_resting;
  setup.role.hosts = config.deployment == Deployment::user_collision;
  setup.role.remember_axes = config.tuning.remember_axes;
  setup.role.may_be_lost = state.nodes_may_be_lost();
  setup.objects = config.capacities.objects;
  setup.pairs = config.capacities.pairs;
  setup.faults = &state.faults;
  setup.timeline = config.timeline;
  setup.connect_to_server = [&state](const PoolNode& node, std::size_t count) {
    return connect_to_server(state, node, count);
  };
  setup.connect = [&state](const PoolNode& first, const PoolNode& second, std::size_t) {
    return connect_nodes(state, first, second);
  };
  setup.start_worker = [&state](Worker& worker) { return state.starter.start(worker); };
  return setup;
}

}  // namespace

bool was_lost(const FrameReport& report, NodeNumber id) noexcept {
  return std::find(report.lost.begin(), report.lost.end(), NodeId(id)) != report.lost.end();
}

CdNodes::CdNodes(WorldState& state) : state_(state), pool_(pool_setup(state)) {}

std::vector<nodes::Connection> CdNodes::make_first(const regions::RegionMap& map) {
  const WorldConfig& config = state_.config;
  std::vector<RemoteNodes::MemberId> members(map.nodes(), RemoteNodes::local_member);
  if (config.remote_nodes != nullptr) {
    const std::uint32_t* log2 = map.grid().log2;
    config.remote_nodes->open({&config, state_.layer_masks, {log2[0], log2[1], log2[2]}, state_.server_bell()});
    members = config.remote_nodes->wait_for_nodes(map.nodes());
  }
  const bool own_threads = state_.threaded() && config.remote_nodes == nullptr;
  if (own_threads && !pool_.prepare_threads(map.nodes())) {
    state_.starter.throw_no_thread();
  }
  std::vector<nodes::Connection> connections;
  for (const RemoteNodes::MemberId member : members) {
    connections.push_back(pool_.add(map, map.nodes(), own_threads, member).server.first);
  }
  return connections;
}

void CdNodes::connect(nodes::ServerRole& server) {
  state_.assign_server_thread({});
  state_.shared_control.set_server_bell(state_.server_bell());
  server.set_wake_tree(pool_.connect());
  assign_remote_nodes(server);
  state_.assign_server_thread(server_thread_roles(server));
}

std::vector<Steppable> CdNodes::server_thread_roles(nodes::ServerRole& server) const {
  std::vector<Steppable> roles{Steppable::of(server)};
  pool_.each([&](PoolNode& node) {
    if (node.role != nullptr && node.worker == nullptr) {
      roles.push_back(Steppable::of(*node.role));
    }
  });
  if (state_.config.remote_nodes != nullptr) {
    roles.push_back(state_.config.remote_nodes->bridge());
  }
  return roles;
}

// Precondition: no thread steps the bridge.
void CdNodes::assign_remote_nodes(nodes::ServerRole& server) {
  const WorldConfig& config = state_.config;
  if (config.remote_nodes == nullptr) {
    return;
  }
  std::vector<RemoteNodes::NodeAssignment> assignments(pool_.slots());
  pool_.each([&](const PoolNode& node) {
    RemoteNodes::NodeAssignment& assignment = assignments[node.slot];
    assignment.id = node.id;
    assignment.objects = NodePool::share_of(config.capacities.objects, pool_.size());
    assignment.pairs = NodePool::share_of(config.capacities.pairs, pool_.size());
    assignment.member = node.member;
    if (assignment.member != RemoteNodes::local_member) {
      assignment.server = node.server.second;
      assignment.peers = pool_.peers_of(node);
    }
  });
  config.remote_nodes->assign(server, assignments, server.map());
}

void CdNodes::replace_last(nodes::ServerRole& server) {
  nodes::FrameOrder& order = state_.order;
  state_.assign_server_thread({Steppable::of(server)});  // without the bridge: all remote nodes are lost
  const PoolNode& node = pool_.replace(order.fallback_slot, server.map());
  state_.assign_server_thread({Steppable::of(server), Steppable::of(*node.role)});
  order.fallback_id = node.id;
  order.fallback = node.server.first;
  // Pairs with the server's acquire load: the members above are valid.
  order.fallback_ready.store(true, std::memory_order_release);
  state_.server_bell()->ring();
}

// The thread must not step the role meanwhile. A node that the server's thread steps must not block that thread.
bool CdNodes::inject(const Fault& fault, nodes::ServerRole& server) {
  const PoolNode* node = pool_.find(fault.node.number());
  const bool can_block = node != nullptr && node->worker != nullptr;
  if (node == nullptr || node->role == nullptr ||
      (!can_block && static_cast<std::size_t>(fault.stage) >= boundary_stage_count)) {
    return false;
  }
  nodes::CdNodeRole& role = *node->role;
  if (can_block) {
    node->worker->assign({});
    role.fail(fault);
    node->worker->assign({Steppable::of(role)});
  } else {
    state_.assign_server_thread({Steppable::of(server)});
    role.fail(fault);
    state_.assign_server_thread(server_thread_roles(server));
  }
  return true;
}

}  // namespace ringfence::facade
