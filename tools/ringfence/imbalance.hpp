#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace ringfence::tools {

/// How unevenly something is spread over the nodes: that of the busiest over the mean, summed over windows of frames.
/// Single frames are too short for clocks of CPU time: one interruption would be all that they show.
class Imbalance {
 public:
  static constexpr std::uint32_t window = 16;  ///< frames

  /// One frame, one value a node. A window with another number of nodes, or not whole, is left out.
  void add(std::span<const double> values);

  double mean() const noexcept { return windows_ == 0 ? 1 : sum_ / windows_; }  ///< over windows; 1 without one
  double max() const noexcept { return max_; }
  std::uint32_t windows() const noexcept { return windows_; }

 private:
  std::vector<double> totals_;  ///< by node
  std::uint32_t frames_ = 0;    ///< in totals_
  std::uint32_t windows_ = 0;
  double sum_ = 0;
  double max_ = 1;
};

}  // namespace ringfence::tools
