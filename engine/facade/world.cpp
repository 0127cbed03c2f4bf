#include "ringfence/world.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <string>
#include <utility>

#include "facade/config_check.hpp"
#include "facade/contact_index.hpp"
#include "facade/crew.hpp"
#include "facade/registry.hpp"
#include "geometry/shape_table.hpp"
#include "link/channel.hpp"
#include "nodes/cd_node_role.hpp"
#include "nodes/server_role.hpp"
#include "nodes/user_role.hpp"
#include "regions/region_map.hpp"
#include "telemetry/track.hpp"

namespace ringfence {

using facade::Steppable;
using facade::Worker;
using nodes::Line;
using nodes::Request;

namespace {

constexpr std::size_t server_node_ring = std::size_t{1} << 20;
constexpr std::size_t user_ring = std::size_t{1} << 16;
constexpr std::size_t most_interest_cells = std::size_t{1} << 15;

/// The way between two roles: one channel each way.
struct Way {
  Way(std::size_t bytes, link::Doorbell* first, link::Doorbell* second)
      : forth(bytes, second, first), back(bytes, first, second) {}
  Line first() noexcept { return {&forth.sender(), &back.receiver()}; }
  Line second() noexcept { return {&back.sender(), &forth.receiver()}; }
  link::Channel forth;
  link::Channel back;
};

/// A connected user node and all that is its own.
struct User {
  User(std::size_t ring_bytes, link::Doorbell* server, link::Doorbell* own, std::size_t cells)
      : way(ring_bytes, server, own), publication(cells, 64) {}
  Way way;
  link::Publication publication;
  std::unique_ptr<nodes::UserRole> role;
  std::size_t worker = 0;
};

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

struct World::Implementation {
  explicit Implementation(WorldConfig given);

  bool threaded() const noexcept { return config.nodes > 0; }
  bool under_way() const noexcept { return begun != frames; }
  std::size_t ring_bytes(std::size_t by_role) const noexcept {
    return config.ring_bytes != 0 ? config.ring_bytes : by_role;
  }
  link::Doorbell* server_bell() noexcept { return threaded() ? &server_worker->bell() : nullptr; }

  void build_server();
  void start_worker(Worker& worker);
  Line add_node(const regions::RegionMap& map, std::uint32_t count);
  void introduce_nodes();
  void grow_nodes();
  void retire_nodes();
  void list_in_place();
  void connect_users();
  void forget_users();
  void assign_users();
  Status refuse(Status status) noexcept {
    ++refused[static_cast<std::size_t>(status)];
    return status;
  }
  Status check_spec(const ObjectSpec& spec) const noexcept;
  bool is_connected(UserNumber user) const noexcept { return std::binary_search(users.begin(), users.end(), user); }
  void step_in_place();
  void log(LogLevel level, const std::string& line) const {
    if (config.log) {
      config.log(level, line);
    }
  }
  void log_growth();
  void gather_timeline();

  WorldConfig config;
  geometry::ShapeTable shapes;
  geometry::FixedSpace space;
  link::Cores cores;
  std::size_t next_core = 0;
  facade::Registry registry;
  nodes::Publications publications;
  std::unique_ptr<link::Publication> relay;
  link::Doorbell caller_bell;
  nodes::FrameOrder order;

  std::vector<Request> requests;  ///< for the next cut
  struct Steering {
    UserNumber user;
    ObjectNumber number;
    Pose pose;
  };
  std::vector<Steering> steerings;  ///< for the next frame
  std::vector<UserNumber> users;    ///< connected or about to be, ascending
  std::vector<UserNumber> leaving;  ///< disconnected; their numbers are in use until the next cut
  std::vector<UserNumber> cut_leaving;
  std::array<std::uint64_t, status_count> refused{};
  std::uint64_t begun = 0;
  std::uint64_t frames = 0;
  FrameReport report;
  std::uint64_t users_cpu_ns = 0;
  telemetry::Track server_track;
  std::deque<telemetry::Track> node_tracks;
  std::deque<telemetry::Track> user_tracks;
  std::uint32_t resize_to = 0;  ///< nodes from the frame after the next on; 0: as they are
  bool growth_logged = false;
  mutable facade::ContactIndex contact_index;
  mutable std::uint64_t indexed_frames = 0;

  // Roles use the channels above them; threads, last of all, use the roles and end first.
  std::unique_ptr<Worker> server_worker;
  std::deque<Worker> node_workers;
  std::deque<Worker> user_workers;
  std::vector<std::unique_ptr<Way>> node_ways;
  std::map<std::pair<NodeNumber, NodeNumber>, std::unique_ptr<Way>> peer_ways;  ///< lower number first
  std::map<UserNumber, std::unique_ptr<User>> user_nodes;
  std::vector<std::unique_ptr<nodes::CdNodeRole>> node_roles;
  std::unique_ptr<nodes::ServerRole> server;
  std::vector<Steppable> in_place;  ///< all roles, where the calling thread steps them

  struct Stop {
    Implementation& world;
    ~Stop() {
      world.user_workers.clear();
      world.node_workers.clear();
      world.server_worker.reset();
    }
  } stop{*this};
};

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
  setup.track = config.timeline ? &server_track : nullptr;
  const regions::RegionMap map(region_grid(config, space), std::max(1u, config.nodes));
  if (threaded()) {
    server_worker = std::make_unique<Worker>();
    start_worker(*server_worker);
  }
  for (NodeNumber node = 0; node < map.nodes(); ++node) {
    setup.nodes.push_back(add_node(map, map.nodes()));
  }
  server = std::make_unique<nodes::ServerRole>(setup, map);
  introduce_nodes();
  if (threaded()) {
    server_worker->assign({Steppable::of(*server)});
    user_workers.resize(config.user_threads);
    for (Worker& worker : user_workers) {
      start_worker(worker);
    }
  }
}

// One core each for the server and the nodes where there are enough; user threads go where there is room.
void World::Implementation::start_worker(Worker& worker) {
  worker.start(config.pin ? &cores : nullptr, config.pin ? next_core++ : Worker::unpinned);
}

// Makes the next CD node of `count` in the end, not yet introduced to its peers and not yet stepped; returns the
// server's end of its line.
Line World::Implementation::add_node(const regions::RegionMap& map, std::uint32_t count) {
  const auto node = static_cast<NodeNumber>(node_roles.size());
  link::Doorbell* bell = nullptr;
  if (threaded()) {
    start_worker(node_workers.emplace_back());
    bell = &node_workers.back().bell();
  }
  node_ways.push_back(std::make_unique<Way>(ring_bytes(server_node_ring), server_bell(), bell));
  // Many nodes need many rings between them; a hand-over is small.
  const std::size_t peer_ring = ring_bytes(std::size_t{1} << (count <= 16 ? 18 : count <= 64 ? 14 : 12));
  for (NodeNumber peer = 0; peer < node; ++peer) {
    peer_ways[{peer, node}] = std::make_unique<Way>(peer_ring, threaded() ? &node_workers[peer].bell() : nullptr, bell);
  }
  nodes::CdNodeSetup setup;
  setup.node = node;
  setup.shapes = &shapes;
  setup.space = &space;
  setup.model = config.motion.get();
  setup.placement = config.placement;
  setup.layer_masks = layer_masks(config.layers);
  setup.keep_resting = config.keep_resting;
  setup.shares_thread = !threaded();
  setup.track = config.timeline ? &node_tracks.emplace_back() : nullptr;
  setup.objects = std::min(config.capacities.objects, 2 * config.capacities.objects / count + 64);
  setup.pairs = std::min(config.capacities.pairs, 2 * config.capacities.pairs / count + 64);
  setup.server = node_ways.back()->second();
  node_roles.push_back(std::make_unique<nodes::CdNodeRole>(setup, map));
  return node_ways.back()->first();
}

// Tells every node of the others and lets the threads step them.
void World::Implementation::introduce_nodes() {
  const auto count = static_cast<NodeNumber>(node_roles.size());
  for (NodeNumber node = 0; node < count; ++node) {
    if (threaded()) {
      node_workers[node].assign({});
    }
    std::vector<Line> peers(count);
    for (NodeNumber peer = 0; peer < count; ++peer) {
      if (peer != node) {
        Way& way = *peer_ways.at({std::min(peer, node), std::max(peer, node)});
        peers[peer] = node < peer ? way.first() : way.second();
      }
    }
    node_roles[node]->meet(node, peers);
    if (threaded()) {
      node_workers[node].assign({Steppable::of(*node_roles[node])});
    }
  }
  list_in_place();
}

// No frame is under way.
void World::Implementation::grow_nodes() {
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
  const NodeNumber count = server->map().nodes();
  if (node_roles.size() == count) {
    return;
  }
  std::vector<std::unique_ptr<Way>> retired;  // until the others have forgotten the way
  while (node_roles.size() > count) {
    const auto node = static_cast<NodeNumber>(node_roles.size() - 1);
    if (threaded()) {
      node_workers[node].assign({});
    }
    node_roles.pop_back();
    if (config.timeline) {
      node_tracks.pop_back();
    }
    retired.push_back(std::move(node_ways.back()));
    node_ways.pop_back();
    for (NodeNumber peer = 0; peer < node; ++peer) {
      retired.push_back(std::move(peer_ways[{peer, node}]));
      peer_ways.erase({peer, node});
    }
  }
  introduce_nodes();
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

Status World::Implementation::check_spec(const ObjectSpec& spec) const noexcept {
  if (spec.shape >= shapes.size()) {
    return Status::unknown_shape;
  }
  const std::size_t layers = std::max<std::size_t>(1, config.layers.names.size());
  if (spec.layer >= layers) {
    return Status::unknown_layer;
  }
  const bool avatar = spec.category == Category::avatar;
  if (static_cast<std::size_t>(spec.category) > static_cast<std::size_t>(Category::fixed) ||
      avatar != (spec.user != no_user)) {
    return Status::bad_category;
  }
  if (avatar && !is_connected(spec.user)) {
    return Status::unknown_user;
  }
  if (spec.number != 0 && registry.in_use(spec.number)) {
    return Status::number_in_use;
  }
  return registry.live() >= config.limits.objects ? Status::over_capacity : Status::ok;
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

void World::Implementation::gather_timeline() {
  report.timeline.clear();
  std::uint32_t index = 0;
  const auto gather = [&](telemetry::Track& track) {
    for (TimelineSpan span : track.spans()) {
      span.track = index;
      report.timeline.push_back(span);
    }
    track.clear();
    ++index;
  };
  gather(server_track);
  std::for_each(node_tracks.begin(), node_tracks.end(), gather);
  std::for_each(user_tracks.begin(), user_tracks.end(), gather);
}

void World::Implementation::log_growth() {
  if (report.grown != 0 && !growth_logged) {
    growth_logged = true;
    log(LogLevel::warning, "frame " + std::to_string(report.frame) +
                               " outgrew what was reserved: " + std::to_string(report.objects) + " objects, " +
                               std::to_string(report.candidates) + " pairs, " + std::to_string(report.contacts) +
                               " contacts; raise WorldConfig::capacities to keep frames free of allocations");
  }
}

World::World(WorldConfig config) : implementation_(std::make_unique<Implementation>(std::move(config))) {}
World::~World() {
  if (implementation_ != nullptr && implementation_->under_way()) {
    finish_frame();
  }
}

const WorldConfig& World::config() const noexcept { return implementation_->config; }

ShapeNumber World::add_shape(const ShapeDescription& description) {
  if (implementation_->under_way()) {
    throw Error("add_shape: a frame is under way; register shapes before begin_frame or after finish_frame");
  }
  Implementation& w = *implementation_;
  const ShapeNumber shape = w.shapes.add(description);
  if (w.shapes.row(shape).kind == ShapeKind::mesh) {
    const geometry::Mesh& mesh = w.shapes.mesh(w.shapes.row(shape).detail);
    if (mesh.dropped_triangles() > 0) {
      w.log(LogLevel::warning, "shape " + std::to_string(shape) + ": " + std::to_string(mesh.dropped_triangles()) +
                                   " triangles without area are left out of the mesh, " +
                                   std::to_string(mesh.triangles().size()) + " are kept");
    }
  }
  return shape;
}

Connected World::connect(UserNumber user) {
  Implementation& w = *implementation_;
  const auto taken = [&](UserNumber number) {
    const auto holds = [&](const std::vector<UserNumber>& list) {
      return std::find(list.begin(), list.end(), number) != list.end();
    };
    return w.is_connected(number) || holds(w.leaving) || holds(w.cut_leaving);
  };
  if (user == no_user) {
    user = 0;
    while (taken(user)) {
      ++user;
    }
  }
  if (user >= w.config.limits.users) {
    return {w.refuse(Status::over_capacity), no_user};
  }
  if (taken(user)) {
    return {w.refuse(Status::number_in_use), no_user};
  }
  w.users.insert(std::lower_bound(w.users.begin(), w.users.end(), user), user);
  Request request;
  request.kind = Request::Kind::connect;
  request.user = user;
  w.requests.push_back(request);
  return {Status::ok, user};
}

Status World::disconnect(UserNumber user) {
  Implementation& w = *implementation_;
  if (!w.is_connected(user)) {
    return w.refuse(Status::unknown_user);
  }
  w.users.erase(std::lower_bound(w.users.begin(), w.users.end(), user));
  w.leaving.push_back(user);
  w.registry.end_avatars(user);
  std::erase_if(w.steerings, [&](const auto& steering) { return steering.user == user; });
  Request request;
  request.kind = Request::Kind::disconnect;
  request.user = user;
  w.requests.push_back(request);
  return Status::ok;
}

Spawned World::spawn(const ObjectSpec& spec) {
  Implementation& w = *implementation_;
  Request request;
  request.kind = Request::Kind::spawn;
  request.spec = spec;
  Status status = w.check_spec(spec);
  if (status == Status::ok) {
    status = nodes::make_valid(request.spec.pose);
  }
  const ObjectNumber number = spec.number != 0 ? spec.number : w.registry.free_number();
  if (status == Status::ok && number == 0) {
    status = Status::bad_number;
  }
  if (status != Status::ok) {
    return {w.refuse(status), {}};
  }
  request.spec.number = number;
  request.object = w.registry.add(number, spec.category, spec.user);
  w.requests.push_back(request);
  return {Status::ok, request.object};
}

Status World::destroy(ObjectId object) {
  Implementation& w = *implementation_;
  if (w.registry.find(object) == nullptr) {
    return w.refuse(Status::stale_object);
  }
  w.registry.end(object);
  Request request;
  request.kind = Request::Kind::destroy;
  request.object = object;
  w.requests.push_back(request);
  return Status::ok;
}

Status World::destroy(UserNumber user, ObjectId object) {
  Implementation& w = *implementation_;
  if (!w.is_connected(user)) {
    return w.refuse(Status::unknown_user);
  }
  const facade::Registry::Entry* entry = w.registry.find(object);
  if (entry == nullptr) {
    return w.refuse(Status::stale_object);
  }
  return entry->user == user ? destroy(object) : w.refuse(Status::not_host);
}

Status World::move(UserNumber user, ObjectId object, const Pose& pose) {
  Implementation& w = *implementation_;
  if (!w.is_connected(user)) {
    return w.refuse(Status::unknown_user);
  }
  const facade::Registry::Entry* entry = w.registry.find(object);
  if (entry == nullptr) {
    return w.refuse(Status::stale_object);
  }
  if (entry->user != user) {
    return w.refuse(Status::not_host);
  }
  Pose valid = pose;
  if (const Status status = nodes::make_valid(valid); status != Status::ok) {
    return w.refuse(status);
  }
  w.steerings.push_back({user, object.number(), valid});
  return Status::ok;
}

Status World::place(ObjectId object, const Pose& pose) {
  Implementation& w = *implementation_;
  const facade::Registry::Entry* entry = w.registry.find(object);
  if (entry == nullptr) {
    return w.refuse(Status::stale_object);
  }
  if (entry->category == Category::fixed) {
    return w.refuse(Status::bad_category);
  }
  Request request;
  request.kind = Request::Kind::place;
  request.object = object;
  request.spec.pose = pose;
  if (const Status status = nodes::make_valid(request.spec.pose); status != Status::ok) {
    return w.refuse(status);
  }
  w.requests.push_back(request);
  return Status::ok;
}

Status World::remove(ObjectId object) {
  Implementation& w = *implementation_;
  const facade::Registry::Entry* entry = w.registry.find(object);
  if (entry == nullptr) {
    return w.refuse(Status::stale_object);
  }
  if (entry->category == Category::fixed) {
    return w.refuse(Status::bad_category);
  }
  // It was moved before it was taken out, so that move no longer counts.
  std::erase_if(w.steerings, [&](const auto& steering) { return steering.number == object.number(); });
  Request request;
  request.kind = Request::Kind::remove;
  request.object = object;
  w.requests.push_back(request);
  return Status::ok;
}

Status World::resize(std::uint32_t nodes) {
  Implementation& w = *implementation_;
  if (nodes == 0 || nodes > 1024 || nodes > w.server->map().grid().cells()) {
    return w.refuse(Status::bad_number);
  }
  w.resize_to = nodes;
  return Status::ok;
}

std::uint32_t World::nodes() const noexcept { return static_cast<std::uint32_t>(implementation_->report.nodes.size()); }

Status World::advance() {
  const Status status = begin_frame();
  return status == Status::ok ? finish_frame() : status;
}

Status World::begin_frame() {
  Implementation& w = *implementation_;
  if (w.under_way()) {
    return w.refuse(Status::out_of_order);
  }
  w.registry.cut();
  w.cut_leaving.swap(w.leaving);
  w.order.requests.swap(w.requests);
  w.connect_users();
  w.grow_nodes();
  for (const auto& steering : w.steerings) {
    w.user_nodes.at(steering.user)->role->steer(steering.number, steering.pose);
  }
  w.steerings.clear();
  ++w.begun;
  w.order.ordered.store(w.begun, std::memory_order_release);
  if (w.threaded()) {
    w.server_worker->bell().ring();
  }
  return Status::ok;
}

Status World::finish_frame() {
  Implementation& w = *implementation_;
  if (!w.under_way()) {
    return w.refuse(Status::out_of_order);
  }
  if (w.threaded()) {
    w.caller_bell.wait([&] { return w.order.completed.load(std::memory_order_acquire) == w.begun; });
  } else {
    w.step_in_place();
  }
  ++w.frames;
  w.order.requests.clear();
  w.registry.forget_cut();
  w.forget_users();

  w.report = w.server->report(w.frames - 1);
  for (std::size_t reason = 0; reason < status_count; ++reason) {
    w.report.refused[reason] += std::exchange(w.refused[reason], 0);
  }
  std::uint64_t cpu_ns = 0;
  for (Worker& worker : w.user_workers) {
    cpu_ns += worker.cpu_ns();
  }
  w.report.users_cpu_ms = static_cast<double>(cpu_ns - std::exchange(w.users_cpu_ns, cpu_ns)) * 1e-6;
  w.gather_timeline();
  w.retire_nodes();
  w.log_growth();
  return Status::ok;
}

std::uint64_t World::frames() const noexcept { return implementation_->frames; }

std::span<const Contact> World::contacts() const noexcept {
  const Implementation& w = *implementation_;
  return w.frames == 0 ? std::span<const Contact>{} : w.server->ledger().contacts(w.frames - 1);
}

std::span<const Contact> World::ended() const noexcept {
  const Implementation& w = *implementation_;
  return w.frames == 0 ? std::span<const Contact>{} : w.server->ledger().ended(w.frames - 1);
}

std::span<const Contact> World::collisions_of(UserNumber user) const noexcept {
  const Implementation& w = *implementation_;
  const auto at = w.user_nodes.find(user);
  return w.frames == 0 || at == w.user_nodes.end() ? std::span<const Contact>{}
                                                   : at->second->role->contacts(w.frames - 1);
}

ObjectContacts World::collisions_of(ObjectId object) const {
  const Implementation& w = *implementation_;
  if (w.registry.find(object) == nullptr || w.frames == 0) {
    return {};
  }
  if (w.indexed_frames != w.frames) {
    w.contact_index.build(contacts());
    w.indexed_frames = w.frames;
  }
  return {contacts().data(), w.contact_index.of(object.number())};
}

std::span<const std::span<const SeenState>> World::seen_by(UserNumber user) const noexcept {
  const Implementation& w = *implementation_;
  const auto at = w.user_nodes.find(user);
  if (w.frames == 0 || at == w.user_nodes.end()) {
    return {};
  }
  return at->second->role->seen(w.frames - 1);
}

namespace {

ObjectView view_of(const nodes::ObjectTable& objects, std::uint32_t slot) {
  const nodes::ObjectRow& row = objects.row(slot);
  const nodes::ObjectOrigin& origin = objects.origin(slot);
  ObjectView view;
  view.id = ObjectId::of(row.object.number, row.object.generation);
  view.spec = {row.object.number,
               row.shape,
               static_cast<Category>(row.category),
               static_cast<std::uint8_t>(row.layer),
               (row.object.flags & messages::flag_present) != 0,
               origin.user,
               origin.user_data,
               row.pose};
  return view;
}

}  // namespace

ObjectView World::object(ObjectId object) const noexcept {
  const Implementation& w = *implementation_;
  if (w.under_way() || w.registry.find(object) == nullptr) {
    return {};
  }
  const nodes::ObjectTable& table = w.server->objects();
  const std::uint32_t slot = table.find(object.number());
  const bool there = slot != nodes::NumberIndex::none && table.row(slot).object.generation == object.generation();
  return there ? view_of(table, slot) : ObjectView{};
}

std::vector<ObjectView> World::objects() const {
  const Implementation& w = *implementation_;
  std::vector<ObjectView> views;
  if (w.under_way()) {
    return views;
  }
  const nodes::ObjectTable& table = w.server->objects();
  views.reserve(table.live());
  for (std::uint32_t slot = 0; slot < table.slots(); ++slot) {
    if (table.alive(slot)) {
      views.push_back(view_of(table, slot));
    }
  }
  std::sort(views.begin(), views.end(),
            [](const ObjectView& p, const ObjectView& q) { return p.spec.number < q.spec.number; });
  return views;
}

ObjectId World::find(ObjectNumber number) const noexcept { return implementation_->registry.find(number); }

const ShapeDescription& World::shape(ShapeNumber shape) const noexcept {
  return implementation_->shapes.description(shape);
}

std::size_t World::shape_count() const noexcept { return implementation_->shapes.size(); }

const FrameReport& World::report() const noexcept { return implementation_->report; }

}  // namespace ringfence
