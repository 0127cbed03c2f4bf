#include "imbalance.hpp"

#include <algorithm>
#include <numeric>

namespace ringfence::tools {

void Imbalance::add(std::span<const double> values) {
  if (values.size() != totals_.size()) {
    totals_.assign(values.size(), 0.0);
    frames_ = 0;
  }
  for (std::size_t i = 0; i < values.size(); ++i) totals_[i] += values[i];
  if (++frames_ < window) return;
  const double sum = std::accumulate(totals_.begin(), totals_.end(), 0.0);
  if (sum > 0) {
    const double busiest = *std::max_element(totals_.begin(), totals_.end());
    const double ratio = busiest * static_cast<double>(totals_.size()) / sum;
    sum_ += ratio;
    max_ = std::max(max_, ratio);
    ++windows_;
  }
  std::fill(totals_.begin(), totals_.end(), 0.0);
  frames_ = 0;
}

}  // namespace ringfence::tools
