#include "regions/balance.hpp"

#include <algorithm>
#include <numeric>

namespace ringfence::regions {

namespace {

double max_over_mean(std::span<const double> values) {
  const double sum = std::accumulate(values.begin(), values.end(), 0.0);
  if (values.empty() || sum <= 0) {
    return 1;
  }
  return *std::max_element(values.begin(), values.end()) * static_cast<double>(values.size()) / sum;
}

}  // namespace

Balance::Balance(const CellGrid& grid, const BalanceConfig& config, std::size_t weights)
    : config_(config), refinement_(grid), bisection_(grid), proposed_(grid, 1) {
  constexpr std::size_t max_nodes = 1024;
  costs_.reserve(max_nodes);
  reference_costs_.reserve(max_nodes);
  node_weights_.reserve(max_nodes);
  weights_.reserve(weights);
  owners_.reserve(weights);
}

void Balance::add_frame(std::span<const double> costs) {
  if (costs.size() != costs_.size() || frames_ >= config_.window) {
    costs_.assign(costs.size(), 0.0);
    frames_ = 0;
  }
  for (std::size_t node = 0; node < costs.size(); ++node) {
    costs_[node] += costs[node];
  }
  ++frames_;
  ++frames_since_weights_;
}

double Balance::imbalance() const noexcept { return max_over_mean(costs_); }

bool Balance::needs_new_map() const noexcept {
  return frames_ == config_.window && frames_since_weights_ >= config_.min_interval && imbalance() > config_.tolerance;
}

void Balance::begin_weights() {
  reference_costs_ = costs_;
  frames_since_weights_ = 0;
  weights_.clear();
  objects_ = sized_objects_ = 0;
  std::fill(std::begin(extents_), std::end(extents_), 0);
}

void Balance::add_object_size(const geometry::Bounds& bounds) {
  ++sized_objects_;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    extents_[axis] += bounds.upper[axis] - bounds.lower[axis];
  }
}

void Balance::scale_by_cost(const RegionMap& map) {
  node_weights_.assign(map.nodes(), 0.0);
  owners_.resize(weights_.size());
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    owners_[i] = map.owner_at(weights_[i].point);
    node_weights_[owners_[i]] += static_cast<double>(weights_[i].weight);
  }
  for (std::size_t node = 0; node < node_weights_.size(); ++node) {
    const bool known = node_weights_[node] > 0 && reference_costs_[node] > 0;
    node_weights_[node] = known ? reference_costs_[node] / node_weights_[node] : 1.0;
  }
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    weights_[i].weight = static_cast<float>(static_cast<double>(weights_[i].weight) * node_weights_[owners_[i]]);
  }
}

void Balance::refine(const RegionMap& map, std::uint32_t nodes) {
  if (reference_costs_.size() == map.nodes()) {
    scale_by_cost(map);
  }
  double total = 0;
  for (const Weight& each : weights_) {
    total += static_cast<double>(each.weight);
  }
  // Parts that are smaller than the average object do not help: each object would be in many of them.
  std::uint32_t smallest[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    smallest[axis] = static_cast<std::uint32_t>(
        std::max<std::uint64_t>(1, extents_[axis] / std::max<std::size_t>(1, sized_objects_)));
  }
  refinement_.refine(weights_, total / nodes / config_.grain, smallest);
}

bool Balance::pays_off(const RegionMap& map, std::span<const NodeNumber> owners, std::size_t resent) {
  node_weights_.assign(map.nodes(), 0.0);
  const auto leaves = refinement_.leaves();
  for (std::size_t leaf = 0; leaf < leaves.size(); ++leaf) {
    node_weights_[owners[leaf]] += leaves[leaf].weight;
  }
  const double gain = max_over_mean(reference_costs_) - max_over_mean(node_weights_);
  if (gain < config_.gain) {
    return false;
  }
  proposed_.assign(refinement_.table(owners), map.nodes(), map.epoch() + 1);
  const auto stays = [&](const Weight& each) { return map.owner_at(each.point) == proposed_.owner_at(each.point); };
  const auto objects = std::span<const Weight>(weights_).first(objects_);
  const auto moved = objects_ - static_cast<std::size_t>(std::count_if(objects.begin(), objects.end(), stays));
  const double cost = static_cast<double>(objects_) * config_.per_object_ms +
                      static_cast<double>(resent) * config_.resend_ms +
                      static_cast<double>(moved) * config_.hand_over_ms;
  const double mean =
      std::accumulate(reference_costs_.begin(), reference_costs_.end(), 0.0) / config_.window / map.nodes();
  return gain * mean * config_.horizon > cost;
}

std::span<const std::uint32_t> Balance::propose(const RegionMap& map, std::size_t resent) {
  const auto owners = bisection_.split(map.nodes(), refinement_.leaves());
  return pays_off(map, owners, resent) ? proposed_.table() : std::span<const std::uint32_t>{};
}

std::span<const std::uint32_t> Balance::partition_for(std::uint32_t nodes) {
  return refinement_.table(bisection_.split(nodes, refinement_.leaves()));
}

}  // namespace ringfence::regions
