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

Balance::Balance(const CellGrid& grid, const BalanceConfig& config)
    : config_(config), weights_(grid.cells()), bisection_(grid) {
  constexpr std::size_t most_nodes = 1024;
  costs_.reserve(most_nodes);
  shares_.reserve(most_nodes);
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

bool Balance::wanted() const noexcept {
  return frames_ == config_.window && rested_ >= config_.rest && imbalance() > config_.tolerance;
}

void Balance::start_weighing() { std::fill(weights_.begin(), weights_.end(), 0.0); }

void Balance::scale_by_cost(const RegionMap& map) {
  shares_.assign(map.nodes(), 0.0);
  for (std::size_t cell = 0; cell < weights_.size(); ++cell) {
    shares_[map.owners()[cell]] += weights_[cell];
  }
  for (std::size_t cell = 0; cell < weights_.size(); ++cell) {
    const NodeNumber node = map.owners()[cell];
    weights_[cell] *=
        shares_[node] > 0 && node < costs_.size() && costs_[node] > 0 ? costs_[node] / shares_[node] : 1.0;
  }
}

std::span<const NodeNumber> Balance::propose(const RegionMap& map) {
  rested_ = 0;
  scale_by_cost(map);
  const auto owners = bisection_.split(map.nodes(), weights_);
  shares_.assign(map.nodes(), 0.0);
  for (std::size_t cell = 0; cell < weights_.size(); ++cell) {
    shares_[owners[cell]] += weights_[cell];
  }
  const bool worth = most_over_mean(shares_) + config_.gain <= imbalance();
  return worth ? owners : std::span<const NodeNumber>{};
}

std::span<const NodeNumber> Balance::share_out(const RegionMap& map, std::uint32_t nodes) {
  rested_ = 0;
  if (costs_.size() == map.nodes()) {
    scale_by_cost(map);
  }
  return bisection_.split(nodes, weights_);
}

}  // namespace ringfence::regions
