#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "ringfence/ids.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// The regions of a world seen from above: which CD nodes own space in each vertical column.
///
/// The world's bounds are divided into `side` times `side` columns, which is finer than the cells of most region maps;
/// cells that are cut more often are drawn at this resolution.
class RegionPlan {
 public:
  static constexpr std::size_t side = 256;

  /// Adjacent columns with the same owners: columns x to end_x - 1 and y to end_y - 1.
  struct Area {
    std::size_t x, y, end_x, end_y;
    std::size_t owners;  ///< index into owners()
  };
  /// A piece of the boundary between columns with different owners, in columns.
  struct Boundary {
    std::size_t x, y, end_x, end_y;
  };

  /// Precondition: no frame is running.
  explicit RegionPlan(const World& world);

  /// The different sets of owners of a column, in the order of their first column; each from the lowest to the highest
  /// part of the column.
  const std::vector<std::vector<NodeId>>& owners() const noexcept { return owners_; }
  /// Disjoint areas that cover all columns.
  std::vector<Area> areas() const;
  std::vector<Boundary> boundaries() const;
  /// The highest, and there the leftmost, box of `width` by `height` columns that all have these owners. Empty if there
  /// is none.
  std::optional<Area> first_area(std::size_t owners, std::size_t width, std::size_t height) const;

 private:
  std::size_t at(std::size_t x, std::size_t y) const noexcept { return columns_[y * side + x]; }

  std::vector<std::vector<NodeId>> owners_;
  std::vector<std::size_t> columns_;  ///< index into owners_; x varies fastest
};

}  // namespace ringfence::tools
