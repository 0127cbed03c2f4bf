// Who there is: the roles, their lines to each other and the threads that step them; made, joined and let go.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "facade/config_check.hpp"
#include "facade/implementation.hpp"

namespace ringfence {

using facade::fleet_ring;
using facade::server_node_ring;
using facade::Steppable;
using facade::User;
using facade::Way;
using facade::Worker;
using nodes::Line;
using nodes::Request;

namespace {

constexpr std::size_t user_ring = std::size_t{1} << 16;
constexpr std::size_t most_interest_cells = std::size_t{1} << 15;

regions::CellGrid region_grid(const WorldConfig& config, const geometry::FixedSpace& space) {
  const std::uint32_t* given = config.cells_log2;
  if (given[0] != 0 || given[1] != 0 || given[2] != 0) {
    return {{given[0], given[1], given[2]}};
  }
  const double extents[3] = {space.max().x - space.min().x, space.max().y - space.min().y,
                             space.max().z - space.min().z};
  return regions::CellGrid::choose(extents, std::max<std::size_t>(4096, std::size_t{64} * config.nodes));
}

// Cells of about a third of the interest radius: few spans to read, little read in vain.
regions::CellGrid interest_grid(const WorldConfig& config, const geometry::FixedSpace& space) {
  const double extents[3] = {space.max().x - space.min().x, space.max().y - space.min().y,
                             space.max().z - space.min().z};
  const double side = std::max(config.interest / 3, 1e-3);
  double cells = 1;
  for (const double extent : extents) {
    cells *= std::max(1.0, extent / side);
  }
  return regions::CellGrid::choose(extents, static_cast<std::size_t>(std::min(cells, double{most_interest_cells})));
}

// What one of `count` nodes reserves: twice its even share.
std::size_t share_of(std::size_t capacity, std::size_t count) noexcept {
  return std::min(capacity, 2 * capacity / count + 64);
}

// How often the server looks at the clock, though nothing happens: a quarter of the shorter deadline; 0: never.
std::chrono::nanoseconds tick_of(const Deadlines& deadlines) {
  double ms = std::max(deadlines.node_ms, deadlines.user_ms);
  for (const double deadline : {deadlines.node_ms, deadlines.user_ms}) {
    ms = deadline > 0 ? std::min(ms, deadline) : ms;
  }
  return std::chrono::nanoseconds(static_cast<std::int64_t>(std::ceil(ms * 0.25e6)));
}

// A network may make the bridge wait for what nothing rings for.
std::chrono::nanoseconds fleet_tick(const Deadlines& deadlines) {
  constexpr std::chrono::milliseconds longest(20);
  const std::chrono::nanoseconds tick = tick_of(deadlines);
  return tick.count() == 0 ? longest : std::min<std::chrono::nanoseconds>(tick, longest);
}

std::array<std::uint32_t, 32> layer_masks(const LayerMatrix& layers) {
  std::array<std::uint32_t, 32> masks{};
  const auto named = static_cast<std::uint8_t>(std::max<std::size_t>(1, layers.names.size()));
  const std::uint32_t every = ~std::uint32_t{0} >> (32 - named);
  bool all_collide = true;
  for (std::uint8_t layer = 0; layer < 32; ++layer) {
    masks[layer] = layers.mask(layer);
    all_collide &= layer >= named || (masks[layer] & every) == every;
  }
  if (all_collide) {
    masks.fill(~std::uint32_t{0});  // which spares the sweep its layer columns
  }
  return masks;
}

}  // namespace

World::Implementation::Implementation(WorldConfig given)
    : config(facade::settle(std::move(given))),
      space(config.bounds_min, config.bounds_max),
      registry(config.capacities.objects) {
  publications.grid = interest_grid(config, space);
  publications.space = &space;
  relay = std::make_unique<link::Publication>(publications.grid.cells(), config.capacities.objects);
  publications.server.publication = relay.get();
  publications.users.reserve(config.capacities.users);
  order.caller = threaded() ? &caller_bell : nullptr;
  user_tracks.resize(std::max(1u, config.user_threads));
  build_server();
}

// The nodes are there when the server is made: it is given their lines.
void World::Implementation::build_server() {
  nodes::ServerSetup setup;
  setup.shapes = &shapes;
  setup.space = &space;
  setup.model = config.motion.get();
  setup.publications = &publications;
  setup.order = &order;
  setup.deployment = config.deployment;
  setup.placement = config.placement;
  setup.layer_masks = layer_masks(config.layers);
  setup.keep_resting = config.keep_resting;
  setup.capacities = config.capacities;
  setup.interest = config.interest;
  setup.balance = config.balance;
  setup.quotas = config.quotas;
  setup.node_deadline_ns = threaded() ? static_cast<std::uint64_t>(config.deadlines.node_ms * 1e6) : 0;
  setup.user_deadline_ns = threaded() ? static_cast<std::uint64_t>(config.deadlines.user_ms * 1e6) : 0;
  setup.track = config.timeline ? &server_track : nullptr;
  const regions::RegionMap map(region_grid(config, space), std::max(1u, config.nodes));
  if (threaded()) {
    server_worker = std::make_unique<Worker>();
    start_worker(*server_worker, config.fleet != nullptr ? fleet_tick(config.deadlines) : tick_of(config.deadlines));
  }
  std::vector<Fleet::Member> members(map.nodes(), Fleet::nobody);
  if (config.fleet != nullptr) {
    const std::uint32_t* log2 = map.grid().log2;
    config.fleet->open({&config, setup.layer_masks, {log2[0], log2[1], log2[2]}, server_bell()});
    members = config.fleet->await(map.nodes());
  }
  for (const Fleet::Member member : members) {
    setup.nodes.push_back(add_node(map, map.nodes(), member));
  }
  server = std::make_unique<nodes::ServerRole>(setup, map);
  introduce_nodes();
  if (threaded()) {
    user_workers.resize(config.user_threads);
    for (Worker& worker : user_workers) {
      start_worker(worker);
    }
  }
}

// One core each for the server and the nodes where there are enough; user threads go where there is room.
void World::Implementation::start_worker(Worker& worker, std::chrono::nanoseconds tick) {
  worker.start(config.pin ? &cores : nullptr, config.pin ? next_core++ : Worker::unpinned, tick);
}

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
    node_ways.back()->share_memory();
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
  setup.layer_masks = layer_masks(config.layers);
  setup.keep_resting = config.keep_resting;
  setup.hosts = config.deployment == Deployment::user_collision;
  setup.shares_thread = !threaded() || node_workers[node] == nullptr;
  setup.track = config.timeline ? &node_tracks.emplace_back() : nullptr;
  setup.remember_axes = config.remember_axes;
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
  if (node_roles.size() <= count || count == 0) {
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

void World::Implementation::list_in_place() {
  in_place.clear();
  if (threaded()) {
    return;
  }
  in_place.push_back(Steppable::of(*server));
  for (auto& role : node_roles) {
    in_place.push_back(Steppable::of(*role));
  }
  for (auto& [number, user] : user_nodes) {
    in_place.push_back(Steppable::of(*user->role));
  }
}

// No frame is under way: the roles are idle, and the publications nobody reads.
void World::Implementation::connect_users() {
  bool changed = false;
  for (Request& request : order.requests) {
    if (request.kind != Request::Kind::connect) {
      continue;
    }
    const UserNumber number = request.user;
    const std::size_t worker = number % std::max<std::size_t>(1, user_workers.size());
    link::Doorbell* bell = threaded() ? &user_workers[worker].bell() : nullptr;
    auto user = std::make_unique<User>(ring_bytes(user_ring), server_bell(), bell, publications.grid.cells());
    user->worker = worker;
    nodes::UserSetup setup;
    setup.user = number;
    setup.model = config.motion.get();
    setup.publications = &publications;
    setup.interest = config.interest;
    setup.track = config.timeline ? &user_tracks[worker] : nullptr;
    setup.objects = config.deployment == Deployment::user ? 64 : 4;
    setup.server = user->way.second();
    user->role = std::make_unique<nodes::UserRole>(setup);
    request.line = user->way.first();
    if (number >= publications.users.size()) {
      publications.users.resize(number + 1);
    }
    publications.users[number] = {};
    publications.users[number].publication = &user->publication;
    user_nodes[number] = std::move(user);
    changed = true;
  }
  if (changed) {
    assign_users();
  }
}

// The frame whose cut disconnected them is complete: nobody speaks to them or reads what they published.
void World::Implementation::forget_users() {
  if (cut_leaving.empty()) {
    return;
  }
  std::vector<std::unique_ptr<User>> gone;
  for (const UserNumber number : cut_leaving) {
    publications.users[number] = {};
    gone.push_back(std::move(user_nodes[number]));
    user_nodes.erase(number);
  }
  assign_users();
  cut_leaving.clear();
}

void World::Implementation::assign_users() {
  if (!threaded()) {
    list_in_place();
    return;
  }
  std::vector<std::vector<Steppable>> roles(user_workers.size());
  for (auto& [number, user] : user_nodes) {
    roles[user->worker].push_back(Steppable::of(*user->role));
  }
  for (std::size_t worker = 0; worker < user_workers.size(); ++worker) {
    user_workers[worker].assign(std::move(roles[worker]));
  }
}

void World::Implementation::step_in_place() {
  while (order.completed.load(std::memory_order_acquire) != begun) {
    for (const Steppable& role : in_place) {
      role.step(role.role);
    }
  }
}

}  // namespace ringfence
