#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace ringfence::tools {

/// Measures how unevenly a quantity is distributed over the nodes: the maximum over the nodes divided by the mean, both
/// summed over a window of frames. A window is needed for CPU times, because one interrupt dominates a single frame.
class Imbalance {
 public:
  static constexpr std::uint32_t window = 16;  ///< frames per window

  /// Adds one frame with one value per node. If the number of nodes changes, the incomplete window is discarded.
  void add(std::span<const double> values);

  double mean() const noexcept {
    return windows_ == 0 ? 1 : sum_ / windows_;
  }  ///< mean over the windows; 1 without a window
  double max() const noexcept { return max_; }
  std::uint32_t windows() const noexcept { return windows_; }

 private:
  std::vector<double> totals_;  ///< of the current window, by node
  std::uint32_t frames_ = 0;    ///< in the current window
  std::uint32_t windows_ = 0;
  double sum_ = 0;
  double max_ = 1;
};

}  // namespace ringfence::tools
