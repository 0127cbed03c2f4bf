#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "regions/region_map.hpp"

namespace ringfence::regions {

/// A cell of a map, or a part of a cell that was cut: the smallest unit that a node owns.
struct Leaf {
  geometry::Bounds bounds;
  std::uint32_t entry = 0;  ///< index of its owner in the table of the map
  double weight = 0;        ///< at least 0
};

/// Divides leaves among nodes by recursive bisection, so that all nodes get nearly the same weight.
///
/// Each cut crosses the longest side (in cells) of the set of leaves that it divides. It is a plane between two layers
/// of leaves, except that it may pass through one layer with a single step. So the weights of the nodes are equal to
/// within about the weight of one leaf, and regions stay compact. Cost: proportional to leaves x log2(nodes). Method:
/// recursive coordinate bisection (Berger, Bokhari 1987).
///
/// Threads: one at a time. Memory: 20 bytes a leaf, and 32 a cell if split() for the cells of the grid is used. It is
/// kept for later calls; a call with no more leaves than before allocates nothing.
class Bisection {
 public:
  explicit Bisection(const CellGrid& grid);

  /// Returns the owner of each leaf, in the order of `leaves`. Every node gets at least one leaf. If all weights of a
  /// set are 0, its leaves count equally. The result is valid until the next call. Precondition: the leaves cover the
  /// world without overlap, and `nodes` is 1 to the number of leaves.
  std::span<const NodeNumber> split(std::uint32_t nodes, std::span<const Leaf> leaves);

  /// The same for the cells of the grid. `weights` has one value, at least 0, for each cell, or is empty for equal
  /// weights.
  std::span<const NodeNumber> split(std::uint32_t nodes, std::span<const double> weights);

 private:
  void split_range(std::size_t begin, std::size_t end, std::uint32_t first, std::uint32_t nodes);
  std::size_t longest_axis(std::size_t begin, std::size_t end) const;
  void sort_along(std::size_t axis, std::size_t begin, std::size_t end);
  std::size_t cut(std::size_t begin, std::size_t end, std::uint32_t left, std::uint32_t nodes) const;

  struct SortKey {
    std::uint32_t at;  ///< coordinate
    std::uint32_t leaf;
  };

  CellGrid grid_;
  std::vector<Leaf> cells_;  ///< the cells of the grid, created by the first call that needs them
  std::span<const Leaf> leaves_;
  std::vector<NodeNumber> owners_;
  std::vector<SortKey> sorted_, other_;  ///< `other_`: scratch, parallel
};

/// The leaf that consists of a whole cell.
Leaf leaf_of(const CellGrid& grid, std::uint32_t cell) noexcept;

}  // namespace ringfence::regions
