#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "regions/region_map.hpp"

namespace ringfence::regions {

/// Splits a grid among nodes by recursive bisection, so that each gets nearly the same weight.
///
/// Each cut goes across the longest side of what it cuts and may step by one layer of cells in mid-way, so the shares
/// are even to about the weight of one cell while the regions stay compact. Cost: about cells x log2(nodes).
/// Method: recursive coordinate bisection (Berger, Bokhari 1987).
///
/// Threads: one at a time. Memory: 16 bytes a cell, kept: later runs allocate nothing.
class Bisection {
 public:
  explicit Bisection(const CellGrid& grid);

  /// The owner of each cell. `weights` has one value >= 0 a cell, or is empty for equal weights; `nodes` is 1 to the
  /// number of cells, and every node gets at least one cell. The result lives until the next call.
  std::span<const NodeNumber> split(std::uint32_t nodes, std::span<const double> weights);

 private:
  void split_range(std::size_t begin, std::size_t end, std::uint32_t first, std::uint32_t nodes);
  std::size_t longest_axis(std::size_t begin, std::size_t end) const;
  void sort_along(std::size_t axis, std::size_t begin, std::size_t end);
  std::size_t cut(std::size_t begin, std::size_t end, std::uint32_t left, std::uint32_t nodes) const;
  double weight(std::uint32_t cell) const { return weights_.empty() ? 1.0 : weights_[cell]; }
  std::uint32_t coordinate(std::uint32_t cell, std::size_t axis) const { return grid_.box_of(cell).lower[axis]; }

  CellGrid grid_;
  std::span<const double> weights_;
  std::vector<NodeNumber> owners_;
  std::vector<std::uint32_t> cells_;
  std::vector<std::uint32_t> sorted_;
  std::vector<std::size_t> layer_;
};

}  // namespace ringfence::regions
