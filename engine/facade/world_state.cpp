#include "facade/world_state.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "facade/automatic_bounds.hpp"
#include "facade/config_check.hpp"

namespace ringfence::facade {

namespace {

regions::CellGrid region_grid(const WorldConfig& config, const geometry::FixedSpace& space) {
  const std::uint32_t* given = config.tuning.cells_log2;
  if (given[0] != 0 || given[1] != 0 || given[2] != 0) {
    return {{given[0], given[1], given[2]}};
  }
  const double extents[3] = {space.max().x - space.min().x, space.max().y - space.min().y,
                             space.max().z - space.min().z};
  return regions::CellGrid::choose(extents, std::max<std::size_t>(4096, std::size_t{64} * config.nodes));
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

std::uint64_t nanoseconds(double ms) noexcept { return static_cast<std::uint64_t>(ms * 1e6); }

}  // namespace

WorldState::WorldState(WorldConfig given, std::uint64_t first)
    : first_frame(first),
      bounds_are_open(has_automatic_bounds(given)),
      config(settle(std::move(given))),
      shared_shapes(std::make_shared<geometry::ShapeTable>()),
      shapes(*shared_shapes),
      space(config.bounds_min, config.bounds_max, geometry::Outside::has_octaves),
      layer_masks(masks_of(config.layers)),
      server_publication(nodes_publish() ? 0 : config.capacities.objects, config.interest, kept_frames()),
      halt(threaded() ? &caller_bell : nullptr),
      log(config.log),
      starter(config, halt) {
  publications.server.publication = &server_publication;
  order.caller = threaded() ? &caller_bell : nullptr;
  order.ordered = order.completed = first_frame;
}

nodes::ServerSetup WorldState::server_setup() noexcept {
  nodes::ServerSetup setup;
  setup.shapes = &shapes;
  setup.space = &space;
  setup.model = config.motion.get();
  setup.publications = &publications;
  setup.order = &order;
  setup.deployment = config.deployment;
  setup.placement = config.placement;
  setup.exchange = exchange_kind();
  setup.frame_control = frame_control();
  setup.layer_masks = layer_masks;
  setup.keep_resting = config.tuning.keep_resting;
  setup.capacities = config.capacities;
  setup.deepest_contacts = config.deepest_contacts;
  setup.contact_frames = kept_frames();
  setup.interest = config.interest;
  setup.sense = config.sense;
  setup.balance = config.balance;
  setup.balance_by = config.balance_by;
  setup.quotas = config.quotas;
  setup.nodes_may_be_lost = nodes_may_be_lost();
  setup.node_deadline_ns = threaded() ? nanoseconds(config.deadlines.node_ms) : 0;
  setup.user_deadline_ns = threaded() ? nanoseconds(config.deadlines.user_ms) : 0;
  setup.first_frame = first_frame;
  setup.track = config.timeline ? &server_track : nullptr;
  return setup;
}

regions::RegionMap WorldState::first_map() const {
  return regions::RegionMap(region_grid(config, space), std::max(1u, config.nodes));
}

// The grid of regions was made for a cube, and stays: automatic bounds are a cube too.
void WorldState::choose_bounds() {
  WorldBounds bounds;
  if (bounds_are_open && facade::choose_bounds(order.requests, bounds)) {
    bounds_are_open = false;
    config.bounds_min = bounds.min;
    config.bounds_max = bounds.max;
    space = geometry::FixedSpace(bounds.min, bounds.max, geometry::Outside::has_octaves);
  }
}

void WorldState::start_server_thread() {
  if (!threaded()) {
    return;
  }
  server_worker = std::make_unique<Worker>();
  starter.must_start(*server_worker,
                     config.remote_nodes != nullptr ? remote_nodes_tick(config.deadlines) : tick_of(config.deadlines));
}

void WorldState::assign_server_thread(std::vector<Steppable> roles) {
  if (threaded()) {
    server_worker->assign(std::move(roles));
  } else {
    inline_roles.assign_server(std::move(roles));
  }
}

}  // namespace ringfence::facade
