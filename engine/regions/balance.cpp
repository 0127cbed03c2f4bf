#include "regions/balance.hpp"

#include <algorithm>

namespace ringfence::regions {

namespace {

template <class Values, class Value>
double max_over_mean(const Values& values, Value value) {
  double sum = 0;
  double most = 0;
  for (const auto& each : values) {
    sum += value(each);
    most = std::max(most, value(each));
  }
  return sum <= 0 ? 1 : most * static_cast<double>(values.size()) / sum;
}

double ms_of(const NodeCost& cost) noexcept { return cost.ms; }

}  // namespace

Balance::Balance(const CellGrid& grid, const BalanceConfig& config, std::size_t weights)
    : config_(config), refinement_(grid), bisection_(grid), proposed_(grid, 1) {
  constexpr std::size_t max_nodes = 1024;
  costs_.reserve(max_nodes);
  reference_costs_.reserve(max_nodes);
  node_weights_.reserve(max_nodes);
  scales_.reserve(max_nodes);
  weights_.reserve(weights);
  owners_.reserve(weights);
}

void Balance::add_frame(std::span<const NodeCost> costs) {
  const auto same_node = [](const NodeCost& p, const NodeCost& q) { return p.node == q.node; };
  if (frames_ >= config_.window || !std::equal(costs.begin(), costs.end(), costs_.begin(), costs_.end(), same_node)) {
    costs_.assign(costs.begin(), costs.end());
    frames_ = 0;
  } else {
    for (std::size_t i = 0; i < costs.size(); ++i) {
      costs_[i].ms += costs[i].ms;
    }
  }
  ++frames_;
  ++frames_since_weights_;
}

double Balance::imbalance() const noexcept { return max_over_mean(costs_, ms_of); }

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

// Only if all owners of weights were measured.
void Balance::scale_by_cost(const RegionMap& map) {
  node_weights_.assign(map.nodes(), 0.0);
  owners_.resize(weights_.size());
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    owners_[i] = map.owner_at(weights_[i].point);
    node_weights_[owners_[i]] += static_cast<double>(weights_[i].weight);
  }
  constexpr double unknown = 0;
  scales_.assign(map.nodes(), unknown);
  for (const NodeCost& cost : reference_costs_) {
    if (cost.node < map.nodes()) {
      scales_[cost.node] = node_weights_[cost.node] > 0 && cost.ms > 0 ? cost.ms / node_weights_[cost.node] : 1.0;
    }
  }
  for (std::size_t node = 0; node < scales_.size(); ++node) {
    if (node_weights_[node] > 0 && scales_[node] == unknown) {
      return;
    }
  }
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    weights_[i].weight = static_cast<float>(static_cast<double>(weights_[i].weight) * scales_[owners_[i]]);
  }
}

void Balance::refine(const RegionMap& map, std::uint32_t nodes) {
  scale_by_cost(map);
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

// Bisection numbers the nodes from 0; node_weights_ and leaf_owners_ are set for these numbers and for `nodes`.
void Balance::split(std::span<const NodeNumber> nodes) {
  const auto leaves = refinement_.leaves();
  const auto parts = bisection_.split(static_cast<std::uint32_t>(nodes.size()), leaves);
  node_weights_.assign(nodes.size(), 0.0);
  leaf_owners_.resize(leaves.size());
  for (std::size_t leaf = 0; leaf < leaves.size(); ++leaf) {
    node_weights_[parts[leaf]] += leaves[leaf].weight;
    leaf_owners_[leaf] = nodes[parts[leaf]];
  }
}

bool Balance::pays_off(const RegionMap& map, std::size_t nodes, std::size_t resent) {
  const double gain =
      max_over_mean(reference_costs_, ms_of) - max_over_mean(node_weights_, [](double weight) { return weight; });
  if (gain < config_.gain) {
    return false;
  }
  proposed_.assign(refinement_.table(leaf_owners_), map.nodes(), map.epoch() + 1);
  const auto stays = [&](const Weight& each) { return map.owner_at(each.point) == proposed_.owner_at(each.point); };
  const auto objects = std::span<const Weight>(weights_).first(objects_);
  const auto moved = objects_ - static_cast<std::size_t>(std::count_if(objects.begin(), objects.end(), stays));
  const double cost = static_cast<double>(objects_) * config_.per_object_ms +
                      static_cast<double>(resent) * config_.resend_ms +
                      static_cast<double>(moved) * config_.hand_over_ms;
  double sum = 0;
  for (const NodeCost& reference : reference_costs_) {
    sum += reference.ms;
  }
  const double mean = sum / config_.window / static_cast<double>(nodes);
  return gain * mean * config_.horizon > cost;
}

std::span<const std::uint32_t> Balance::propose(const RegionMap& map, std::span<const NodeNumber> nodes,
                                                std::size_t resent) {
  split(nodes);
  return pays_off(map, nodes.size(), resent) ? proposed_.table() : std::span<const std::uint32_t>{};
}

std::span<const std::uint32_t> Balance::partition_for(std::span<const NodeNumber> nodes) {
  split(nodes);
  return refinement_.table(leaf_owners_);
}

}  // namespace ringfence::regions
