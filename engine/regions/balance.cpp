#include "regions/balance.hpp"

#include <algorithm>
#include <numeric>

namespace ringfence::regions {

namespace {

double most_over_mean(std::span<const double> values) {
  const double sum = std::accumulate(values.begin(), values.end(), 0.0);
  if (values.empty() || sum <= 0) {
    return 1;
  }
  return *std::max_element(values.begin(), values.end()) * static_cast<double>(values.size()) / sum;
}

}  // namespace

Balance::Balance(const CellGrid& grid, const BalanceConfig& config, std::size_t weights)
    : config_(config), refinement_(grid), bisection_(grid), proposed_(grid, 1) {
  constexpr std::size_t most_nodes = 1024;
  costs_.reserve(most_nodes);
  judged_.reserve(most_nodes);
  shares_.reserve(most_nodes);
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
  ++rested_;
}

double Balance::imbalance() const noexcept { return most_over_mean(costs_); }

bool Balance::needs_new_map() const noexcept {
  return frames_ == config_.window && rested_ >= config_.rest && imbalance() > config_.tolerance;
}

void Balance::begin_weights() {
  judged_ = costs_;
  rested_ = 0;
  weights_.clear();
  objects_ = sized_ = 0;
  std::fill(std::begin(extents_), std::end(extents_), 0);
}

void Balance::add_object_size(const geometry::Bounds& bounds) {
  ++sized_;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    extents_[axis] += bounds.upper[axis] - bounds.lower[axis];
  }
}

void Balance::scale_by_cost(const RegionMap& map) {
  shares_.assign(map.nodes(), 0.0);
  owners_.resize(weights_.size());
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    owners_[i] = map.owner_at(weights_[i].point);
    shares_[owners_[i]] += static_cast<double>(weights_[i].weight);
  }
  for (std::size_t node = 0; node < shares_.size(); ++node) {
    const bool known = shares_[node] > 0 && judged_[node] > 0;
    shares_[node] = known ? judged_[node] / shares_[node] : 1.0;
  }
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    weights_[i].weight = static_cast<float>(static_cast<double>(weights_[i].weight) * shares_[owners_[i]]);
  }
}

void Balance::refine(const RegionMap& map, std::uint32_t nodes) {
  if (judged_.size() == map.nodes()) {
    scale_by_cost(map);
  }
  double total = 0;
  for (const Weight& each : weights_) {
    total += static_cast<double>(each.weight);
  }
  // Nothing is gained by parts smaller than what stands in them: it would be in many of them.
  std::uint32_t smallest[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    smallest[axis] =
        static_cast<std::uint32_t>(std::max<std::uint64_t>(1, extents_[axis] / std::max<std::size_t>(1, sized_)));
  }
  refinement_.refine(weights_, total / nodes / config_.grain, smallest);
}

bool Balance::is_worthwhile(const RegionMap& map, std::span<const NodeNumber> owners, std::size_t retold) {
  shares_.assign(map.nodes(), 0.0);
  const auto leaves = refinement_.leaves();
  for (std::size_t leaf = 0; leaf < leaves.size(); ++leaf) {
    shares_[owners[leaf]] += leaves[leaf].weight;
  }
  const double gain = most_over_mean(judged_) - most_over_mean(shares_);
  if (gain < config_.gain) {
    return false;
  }
  proposed_.assign(refinement_.table(owners), map.nodes(), map.epoch() + 1);
  const auto stays = [&](const Weight& each) { return map.owner_at(each.point) == proposed_.owner_at(each.point); };
  const auto objects = std::span<const Weight>(weights_).first(objects_);
  const auto moved = objects_ - static_cast<std::size_t>(std::count_if(objects.begin(), objects.end(), stays));
  const double cost = static_cast<double>(objects_) * config_.per_object_ms +
                      static_cast<double>(retold) * config_.resend_ms +
                      static_cast<double>(moved) * config_.hand_over_ms;
  const double mean = std::accumulate(judged_.begin(), judged_.end(), 0.0) / config_.window / map.nodes();
  return gain * mean * config_.horizon > cost;
}

std::span<const std::uint32_t> Balance::propose(const RegionMap& map, std::size_t retold) {
  const auto owners = bisection_.split(map.nodes(), refinement_.leaves());
  return is_worthwhile(map, owners, retold) ? proposed_.table() : std::span<const std::uint32_t>{};
}

std::span<const std::uint32_t> Balance::partition_for(std::uint32_t nodes) {
  return refinement_.table(bisection_.split(nodes, refinement_.leaves()));
}

}  // namespace ringfence::regions
