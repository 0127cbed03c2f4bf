// The server, the user nodes, and the threads that step roles.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "facade/config_check.hpp"
#include "facade/implementation.hpp"
#include "ringfence/error.hpp"

namespace ringfence {

using facade::Steppable;
using facade::User;
using facade::UserThread;
using facade::Worker;
using nodes::Request;

namespace {

constexpr std::size_t user_ring = std::size_t{1} << 16;
constexpr std::size_t max_interest_cells = std::size_t{1} << 15;

regions::CellGrid region_grid(const WorldConfig& config, const geometry::FixedSpace& space) {
  const std::uint32_t* given = config.tuning.cells_log2;
  if (given[0] != 0 || given[1] != 0 || given[2] != 0) {
    return {{given[0], given[1], given[2]}};
  }
  const double extents[3] = {space.max().x - space.min().x, space.max().y - space.min().y,
                             space.max().z - space.min().z};
  return regions::CellGrid::choose(extents, std::max<std::size_t>(4096, std::size_t{64} * config.nodes));
}

// Cells of about a third of the interest radius: few spans to read, and few states read in vain.
regions::CellGrid interest_grid(const WorldConfig& config, const geometry::FixedSpace& space) {
  const double extents[3] = {space.max().x - space.min().x, space.max().y - space.min().y,
                             space.max().z - space.min().z};
  const double side = std::max(config.interest / 3, 1e-3);
  double cells = 1;
  for (const double extent : extents) {
    cells *= std::max(1.0, extent / side);
  }
  return regions::CellGrid::choose(extents, static_cast<std::size_t>(std::min(cells, double{max_interest_cells})));
}

// How often the server checks its deadlines when no bell rings: a quarter of the shorter deadline; 0: never.
std::chrono::nanoseconds tick_of(const Deadlines& deadlines) {
  double ms = std::max(deadlines.node_ms, deadlines.user_ms);
  for (const double deadline : {deadlines.node_ms, deadlines.user_ms}) {
    ms = deadline > 0 ? std::min(ms, deadline) : ms;
  }
  return std::chrono::nanoseconds(static_cast<std::int64_t>(std::ceil(ms * 0.25e6)));
}

// A congested network rings no bell, so the bridge is also stepped on a timer.
std::chrono::nanoseconds remote_nodes_tick(const Deadlines& deadlines) {
  constexpr std::chrono::milliseconds longest(20);
  const std::chrono::nanoseconds tick = tick_of(deadlines);
  return tick.count() == 0 ? longest : std::min<std::chrono::nanoseconds>(tick, longest);
}

std::array<std::uint32_t, 32> masks_of(const LayerMatrix& layers) {
  std::array<std::uint32_t, 32> masks{};
  const auto named = static_cast<std::uint8_t>(std::max<std::size_t>(1, layers.names.size()));
  const std::uint32_t every = ~std::uint32_t{0} >> (32 - named);
  bool all_collide = true;
  for (std::uint8_t layer = 0; layer < 32; ++layer) {
    masks[layer] = layers.mask(layer);
    all_collide &= layer >= named || (masks[layer] & every) == every;
  }
  if (all_collide) {
    masks.fill(~std::uint32_t{0});  // all layers collide: the sweep then needs no layer column
  }
  return masks;
}

}  // namespace

World::Implementation::Implementation(WorldConfig given)
    : config(facade::settle(std::move(given))),
      space(config.bounds_min, config.bounds_max),
      layer_masks(masks_of(config.layers)),
      registry(config.capacities.objects),
      publications{interest_grid(config, space), &space, {}, {}, {}},
      halt(threaded() ? &caller_bell : nullptr),
      pool(pool_setup()) {
  relay = std::make_unique<link::Publication>(publications.grid.cells(), config.capacities.objects);
  publications.server.publication = relay.get();
  publications.users.reserve(config.capacities.users);
  order.caller = threaded() ? &caller_bell : nullptr;
  build_server();
}

// The nodes are made before the server, which is given their connections.
void World::Implementation::build_server() {
  nodes::ServerSetup setup;
  setup.shapes = &shapes;
  setup.space = &space;
  setup.model = config.motion.get();
  setup.publications = &publications;
  setup.order = &order;
  setup.deployment = config.deployment;
  setup.placement = config.placement;
  setup.layer_masks = layer_masks;
  setup.keep_resting = config.tuning.keep_resting;
  setup.capacities = config.capacities;
  setup.interest = config.interest;
  setup.balance = config.balance;
  setup.balance_by = config.balance_by;
  setup.quotas = config.quotas;
  setup.node_deadline_ns = threaded() ? static_cast<std::uint64_t>(config.deadlines.node_ms * 1e6) : 0;
  setup.user_deadline_ns = threaded() ? static_cast<std::uint64_t>(config.deadlines.user_ms * 1e6) : 0;
  setup.track = config.timeline ? &server_track : nullptr;
  const regions::RegionMap map(region_grid(config, space), std::max(1u, config.nodes));
  if (threaded()) {
    server_worker = std::make_unique<Worker>();
    must_start(*server_worker,
               config.remote_nodes != nullptr ? remote_nodes_tick(config.deadlines) : tick_of(config.deadlines));
  }
  std::vector<RemoteNodes::MemberId> members(map.nodes(), RemoteNodes::local_member);
  if (config.remote_nodes != nullptr) {
    const std::uint32_t* log2 = map.grid().log2;
    config.remote_nodes->open({&config, setup.layer_masks, {log2[0], log2[1], log2[2]}, server_bell()});
    members = config.remote_nodes->wait_for_nodes(map.nodes());
  }
  const bool own_thread = threaded() && config.remote_nodes == nullptr;
  if (own_thread && !pool.prepare_threads(map.nodes())) {
    throw_no_thread();
  }
  for (const RemoteNodes::MemberId member : members) {
    setup.nodes.push_back(pool.add(map, map.nodes(), own_thread, member).server.first);
  }
  server = std::make_unique<nodes::ServerRole>(setup, map);
  connect_pool();
  for (std::uint32_t thread = 0; thread < (threaded() ? config.user_threads : 1); ++thread) {
    user_threads.push_back(make_user_thread());
  }
}

// Throws Error if the system has no thread.
std::unique_ptr<UserThread> World::Implementation::make_user_thread() {
  auto thread = std::make_unique<UserThread>();
  if (threaded()) {
    thread->worker = std::make_unique<Worker>();
    must_start(*thread->worker);
  }
  return thread;
}

nodes::UserThreadParts World::Implementation::parts_of(UserThread& thread) const noexcept {
  return {config.timeline ? &thread.track : nullptr, threaded() ? &thread.clock : nullptr,
          threaded() && config.deadlines.user_ms > 0 ? &thread.watch : nullptr};
}

// With pinning, the server and the nodes get one core each, as far as there are enough; user threads share the rest.
// Returns false if the system has no thread.
bool World::Implementation::start_worker(Worker& worker, std::chrono::nanoseconds tick) {
  if (threads_until_failure && (*threads_until_failure)-- == 0) {
    threads_until_failure.reset();
    return false;
  }
  if (!worker.start(halt, config.pin ? &cores : nullptr, config.pin ? next_core : Worker::unpinned, tick)) {
    return false;
  }
  ++next_core;
  return true;
}

void World::Implementation::must_start(Worker& worker, std::chrono::nanoseconds tick) {
  if (!start_worker(worker, tick)) {
    throw_no_thread();
  }
}

void World::Implementation::throw_no_thread() const {
  throw Error("WorldConfig: the system has no thread for one of " + std::to_string(config.nodes) + " CD nodes, " +
              std::to_string(config.user_threads) +
              " user threads and the server; ask for fewer, or raise the limit on threads (ulimit -u, pids.max)");
}

// All threads end before any is freed: until then each may ring the doorbell of any other.
void World::Implementation::end_threads() noexcept {
  const auto each_worker = [&](auto visit) {
    for (const auto& thread : user_threads) {
      visit(thread->worker.get());
    }
    for (const auto& [number, user] : user_nodes) {
      visit(user->abandoned != nullptr ? user->abandoned->worker.get() : nullptr);
    }
    for (const auto& user : stalled_users) {
      visit(user->abandoned->worker.get());
    }
    pool.each_worker([&](Worker& worker) { visit(&worker); });
    visit(server_worker.get());
  };
  each_worker([](Worker* worker) {
    if (worker != nullptr) {
      worker->dismiss();
    }
  });
  each_worker([](Worker* worker) {
    if (worker != nullptr) {
      worker->join();
    }
  });
}

void World::Implementation::list_inline_roles() {
  inline_roles.clear();
  if (threaded()) {
    return;
  }
  inline_roles.push_back(Steppable::of(*server));
  pool.each([&](facade::PoolNode& node) { inline_roles.push_back(Steppable::of(*node.role)); });
  for (auto& [number, user] : user_nodes) {
    inline_roles.push_back(Steppable::of(*user->role));
  }
}

// Precondition: no frame is running, so roles are idle and publications are not read.
void World::Implementation::connect_users() {
  bool changed = false;
  for (Request& request : order.requests) {
    if (request.kind != Request::Kind::connect) {
      continue;
    }
    const UserNumber number = request.user;
    const std::size_t index = number % user_threads.size();
    UserThread& thread = *user_threads[index];
    link::Doorbell* bell = threaded() ? &thread.worker->bell() : nullptr;
    auto user = std::make_unique<User>(ring_bytes(user_ring), server_bell(), bell, publications.grid.cells());
    user->thread = index;
    nodes::UserSetup setup;
    setup.user = number;
    setup.model = config.motion.get();
    setup.publications = &publications;
    setup.interest = config.interest;
    setup.thread = parts_of(thread);
    setup.objects = config.deployment == Deployment::user ? 64 : 4;
    setup.faults = threaded() ? &faults : nullptr;
    setup.server = user->channel.second();
    user->role = std::make_unique<nodes::UserRole>(setup);
    request.connection = user->channel.first();
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

// The frame whose cut disconnected the users is complete: nothing refers to their channels or publications any more.
void World::Implementation::forget_users() {
  if (cut_leaving.empty()) {
    return;
  }
  parted_users.reserve(parted_users.size() + cut_leaving.size());
  stalled_users.reserve(stalled_users.size() + cut_leaving.size());
  for (const UserNumber number : cut_leaving) {
    publications.users[number] = {};
    const auto at = user_nodes.find(number);
    (at->second->abandoned != nullptr ? stalled_users : parted_users).push_back(std::move(at->second));
    user_nodes.erase(at);
  }
  assign_users();
  parted_users.clear();
  cut_leaving.clear();
}

// Called when a frame is complete. Late user nodes are not stepped any more, so none of them reads publications of the
// next frame. Those whose model has not returned were removed from their threads within the frame.
void World::Implementation::part_with_late_users() {
  for (const UserId user : report.late) {
    user_nodes.at(user.number())->late = true;
    publications.users[user.number()] = {};
  }
  if (!report.late.empty()) {
    assign_users();
  }
}

void World::Implementation::free_stalled_users() {
  std::erase_if(stalled_users, [](const auto& user) { return user->abandoned->worker->has_ended(); });
}

void World::Implementation::assign_users() {
  if (!threaded()) {
    list_inline_roles();
    return;
  }
  std::vector<std::vector<Steppable>> roles(user_threads.size());
  for (auto& [number, user] : user_nodes) {
    if (!user->late) {
      roles[user->thread].push_back(Steppable::of(*user->role));
    }
  }
  for (std::size_t thread = 0; thread < user_threads.size(); ++thread) {
    user_threads[thread]->worker->assign(std::move(roles[thread]));
  }
}

// Returns true when the frame is complete, false if memory ran out.
bool World::Implementation::step_inline() {
  while (order.completed.load(std::memory_order_acquire) != begun) {
    for (const Steppable& role : inline_roles) {
      if (role.step(role.role) == nodes::Step::out_of_memory) {
        return false;
      }
    }
  }
  return true;
}

Status World::Implementation::stop_frames() noexcept {
  halt.set();
  if (!std::exchange(halt_logged, true)) {
    try {
      log(LogLevel::error, "memory ran out in frame " + std::to_string(begun - (frame_is_running() ? 1 : 0)) +
                               ": the World runs no more frames and returns out_of_memory; its last results can be "
                               "read. Destroy it, and give the next one more memory or fewer objects");
    } catch (...) {
      // There is no memory for the log line either; the caller still gets the status.
    }
  }
  return Status::out_of_memory;
}

}  // namespace ringfence
