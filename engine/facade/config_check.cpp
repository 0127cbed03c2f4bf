#include "facade/config_check.hpp"

#include <cmath>
#include <string>

#include "link/channel.hpp"
#include "nodes/exchange/sender_set.hpp"
#include "ringfence/error.hpp"

namespace ringfence {

std::uint32_t LayerMatrix::mask(std::uint8_t layer) const noexcept {
  if (names.empty()) {
    return ~std::uint32_t{0};
  }
  std::uint32_t mask = 0;
  for (const auto& [p, q] : collide) {
    mask |= p == layer ? std::uint32_t{1} << q : 0;
    mask |= q == layer ? std::uint32_t{1} << p : 0;
  }
  return mask;
}

}  // namespace ringfence

namespace ringfence::facade {

static_assert(max_nodes <= nodes::SenderSet::capacity);

namespace {

/// Pairs and contacts have 32-bit indices; one bit marks ended contacts.
constexpr std::size_t max_reserved = std::size_t{1} << 31;

void require(bool holds, const std::string& what) {
  if (!holds) {
    throw Error("WorldConfig: " + what);
  }
}

void check_axis(const char* axis, double min, double max) {
  require(std::isfinite(min) && std::isfinite(max) && min <= max,
          std::string("bounds_min and bounds_max on axis ") + axis + " are " + std::to_string(min) + " and " +
              std::to_string(max) + "; both must be finite, min not above max");
}

void check_layers(const LayerMatrix& layers) {
  require(layers.names.size() <= 32, "layers has " + std::to_string(layers.names.size()) + " names; at most 32");
  require(layers.collide.empty() || !layers.names.empty(), "layers.collide needs layers.names");
  for (const auto& [p, q] : layers.collide) {
    require(p < layers.names.size() && q < layers.names.size(), "layers.collide names layer " +
                                                                    std::to_string(std::max(p, q)) + "; there are " +
                                                                    std::to_string(layers.names.size()));
  }
}

void check_capacity(const char* name, std::size_t capacity, std::size_t limit) {
  require(capacity >= 1 && capacity <= limit,
          std::string("capacities.") + name + " is " + std::to_string(capacity) + "; 1 to " + std::to_string(limit));
}

}  // namespace

void check(const WorldConfig& config) {
  check_axis("x", config.bounds_min.x, config.bounds_max.x);
  check_axis("y", config.bounds_min.y, config.bounds_max.y);
  check_axis("z", config.bounds_min.z, config.bounds_max.z);
  require(config.nodes <= max_nodes,
          "nodes is " + std::to_string(config.nodes) + "; 0 to " + std::to_string(max_nodes));
  require(config.remote_nodes == nullptr || config.nodes >= 1,
          "nodes is 0 with remote_nodes; at least 1 remote node must join");
  require(config.user_threads >= 1 && config.user_threads <= 256,
          "user_threads is " + std::to_string(config.user_threads) + "; 1 to 256");
  for (const std::uint32_t bits : config.tuning.cells_log2) {
    require(bits <= 10, "tuning.cells_log2 holds " + std::to_string(bits) + "; 0 to 10 on each axis");
  }
  require(std::isfinite(config.interest) && config.interest >= 0,
          "interest is " + std::to_string(config.interest) + "; metres, 0 or more");
  require(std::isfinite(config.sense) && config.sense >= 0,
          "sense is " + std::to_string(config.sense) + "; metres, 0 or more");
  require(config.history <= max_history,
          "history is " + std::to_string(config.history) + "; 0 to " + std::to_string(max_history));
  check_capacity("objects", config.capacities.objects, config.limits.objects);
  check_capacity("pairs", config.capacities.pairs, max_reserved);
  check_capacity("contacts", config.capacities.contacts, max_reserved);
  check_capacity("users", config.capacities.users, config.limits.users);
  const auto check_deadline = [](const char* name, double ms) {
    require(std::isfinite(ms) && ms >= 0,
            std::string("deadlines.") + name + " is " + std::to_string(ms) + "; milliseconds, 0 for none");
  };
  check_deadline("node_ms", config.deadlines.node_ms);
  check_deadline("user_ms", config.deadlines.user_ms);
  require(config.quotas.window >= 1, "quotas.window is 0; frames, 1 or more");
  check_layers(config.layers);
  if (config.tuning.ring_bytes != 0) {
    link::Channel::check(config.tuning.ring_bytes, "WorldConfig::tuning.ring_bytes (--ring-bytes)");
  }
  if (config.motion != nullptr) {
    require(config.motion->state_bytes() <= max_motion_state,
            "motion keeps " + std::to_string(config.motion->state_bytes()) + " bytes per object; at most " +
                std::to_string(max_motion_state));
  }
}

// A single node on its own thread tests while the server sweeps. With everything in one thread there is nothing to
// share, and pairs that a node finds itself pass through no ring.
Placement choose_placement(std::uint32_t nodes) noexcept { return nodes == 1 ? Placement::server : Placement::region; }

WorldConfig settle(WorldConfig config) {
  check(config);
  if (config.bounds_min == Vec3d{} && config.bounds_max == Vec3d{}) {
    config.bounds_max = {100, 100, 100};  // until there are objects
  }
  if (config.placement == Placement::automatic) {
    config.placement = choose_placement(config.nodes);
  }
  return config;
}

}  // namespace ringfence::facade
