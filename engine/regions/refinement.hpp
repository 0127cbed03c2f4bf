#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "regions/bisection.hpp"
#include "regions/region_map.hpp"

namespace ringfence::regions {

/// A cost at a fixed-point position.
struct Weight {
  std::uint32_t point[3];
  float weight;
};

/// Cuts the cells that are too heavy for one node: across their longest side, then the two parts again.
///
/// A crowd that fits into one cell can then be divided among nodes. The result is a table for RegionMap whose owners
/// are filled in later. Method: below each heavy cell, a k-d tree with cuts in the middle; where all weight is on one
/// side of the middle, the cut is beside the weight, so that a crowd in a huge cell takes few cuts.
///
/// Threads: one at a time. Memory: grows to the largest result, at most `max_cuts` cuts.
class Refinement {
 public:
  static constexpr std::size_t max_cuts = RegionMap::max_cuts;

  explicit Refinement(const CellGrid& grid);

  /// Sums the weights into leaves. No leaf is heavier than `heaviest`, unless a cut would make a side shorter than
  /// `smallest` (fixed-point steps, at least 1 on each axis) or there are `max_cuts` cuts already.
  void refine(std::span<const Weight> weights, double heaviest, const std::uint32_t (&smallest)[3]);

  /// The leaves of the last refine().
  std::span<const Leaf> leaves() const noexcept { return leaves_; }
  /// The table of the last refine(), with the given owners, one for each leaf. Parts with one owner are not cut.
  std::span<const std::uint32_t> table(std::span<const NodeNumber> owners);

 private:
  struct Limits {
    double heaviest;
    const std::uint32_t* smallest;
  };
  void cut(Leaf leaf, std::size_t begin, std::size_t end, const Limits& limits);
  std::uint32_t plane_of(const Leaf& leaf, std::size_t axis, std::size_t begin, std::size_t end,
                         std::uint32_t margin) const;
  std::uint32_t joined(std::uint32_t entry);
  const Weight& weight_of(std::uint64_t key) const noexcept { return weights_[static_cast<std::uint32_t>(key)]; }

  CellGrid grid_;
  std::vector<double> cell_weights_;
  std::vector<std::uint64_t> heavy_weights_;  ///< weights in heavy cells, sorted: cell << 32 | index
  std::span<const Weight> weights_;
  std::vector<Leaf> leaves_;
  std::vector<std::uint32_t> table_;
  std::vector<std::uint32_t> joined_;  ///< result of table()
};

}  // namespace ringfence::regions
