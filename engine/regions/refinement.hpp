#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "regions/bisection.hpp"
#include "regions/region_map.hpp"

namespace ringfence::regions {

/// Something that costs, and where.
struct Weight {
  std::uint32_t point[3];
  float weight;
};

/// Cuts the cells of a grid that weigh too much for one node in two, across their longest side, and the halves again.
///
/// So a crowd that fits into one cell can still be shared out. The result is a table for RegionMap, with the owners
/// yet to be filled in. Method: a k-d tree with cuts in the middle below each cell that needs one.
///
/// Threads: one at a time. Memory: grows to what was needed most, at most `most_cuts` cuts.
class Refinement {
 public:
  static constexpr std::size_t most_cuts = 16384;

  explicit Refinement(const CellGrid& grid);

  /// Sums the weights into leaves, none heavier than `heaviest` unless it is as small as `smallest` (steps of the fixed
  /// point, at least 1 on each axis; no side is cut to less) or there are `most_cuts` cuts.
  void refine(std::span<const Weight> weights, double heaviest, const std::uint32_t (&smallest)[3]);

  /// The last result, until the next call.
  std::span<const Leaf> leaves() const noexcept { return leaves_; }
  /// The last result as a table with these owners, one a leaf.
  std::span<const std::uint32_t> table(std::span<const NodeNumber> owners);

 private:
  struct Limits {
    double heaviest;
    const std::uint32_t* smallest;
  };
  void cut(Leaf leaf, std::size_t begin, std::size_t end, const Limits& limits);

  CellGrid grid_;
  std::vector<double> cell_weights_;
  std::vector<std::uint64_t> picked_;  ///< weights in heavy cells: cell, then index
  std::span<const Weight> weights_;
  std::vector<Leaf> leaves_;
  std::vector<std::uint32_t> table_;
};

}  // namespace ringfence::regions
