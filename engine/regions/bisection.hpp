#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "regions/region_map.hpp"

namespace ringfence::regions {

/// A cell of a map, or a part of one that was cut: what a node can own.
struct Leaf {
  std::uint32_t lower[3] = {};  ///< its lower corner, fixed point
  std::uint8_t bits[3] = {};    ///< its side on each axis is 2^bits
  std::uint32_t entry = 0;      ///< where the map's table has its owner
  double weight = 0;            ///< >= 0
};

/// Splits leaves among nodes by recursive bisection, so that each gets nearly the same weight.
///
/// Each cut goes across the longest side of what it cuts, counted in cells, and may step by one layer of leaves in
/// mid-way, so the shares are even to about the weight of one leaf while the regions stay compact. Cost: about
/// leaves x log(leaves) x log2(nodes). Method: recursive coordinate bisection (Berger, Bokhari 1987).
///
/// Threads: one at a time. Memory: 24 bytes a leaf, kept: later runs of no more leaves allocate nothing.
class Bisection {
 public:
  explicit Bisection(const CellGrid& grid);

  /// The owner of each leaf, in their order. `leaves` cover the world, each place once; `nodes` is 1 to their number,
  /// and every node gets at least one. Where all weigh nothing they count alike. The result lives until the next call.
  std::span<const NodeNumber> split(std::uint32_t nodes, std::span<const Leaf> leaves);

  /// The same for the cells of the grid: `weights` has one value >= 0 a cell, or is empty for equal weights.
  std::span<const NodeNumber> split(std::uint32_t nodes, std::span<const double> weights);

 private:
  void split_range(std::size_t begin, std::size_t end, std::uint32_t first, std::uint32_t nodes);
  std::size_t longest_axis(std::size_t begin, std::size_t end) const;
  void sort_along(std::size_t axis, std::size_t begin, std::size_t end);
  std::size_t cut(std::size_t begin, std::size_t end, std::uint32_t left, std::uint32_t nodes) const;

  struct Place {
    std::uint64_t key;  ///< coordinate, then the place before it was sorted
    std::uint32_t leaf;
  };

  CellGrid grid_;
  std::vector<Leaf> cells_;  ///< of the grid, made when first asked for
  std::span<const Leaf> leaves_;
  std::vector<NodeNumber> owners_;
  std::vector<Place> places_;
};

/// The leaf that is the whole cell.
Leaf leaf_of(const CellGrid& grid, std::uint32_t cell) noexcept;

}  // namespace ringfence::regions
