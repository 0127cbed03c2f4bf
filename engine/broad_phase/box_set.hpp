#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "broad_phase/kernels.hpp"
#include "broad_phase/row_grid.hpp"
#include "broad_phase/row_layout.hpp"

namespace ringfence::broad_phase {

/// A set of boxes of any mix of sizes: one RowGrid for each size level that holds boxes.
///
/// Levels and row layouts are planned from a sample of the boxes. They are planned again after 64 builds, or earlier
/// when the number of boxes or the share of large boxes has changed by too much. Memory: allocates when the set grows,
/// not for a plan.
class BoxSet {
 public:
  explicit BoxSet(std::size_t boxes);

  /// Replaces the content of the set by the boxes of `slots`, whose order is overwritten. The boxes are staged but not
  /// yet sorted: the sweep sorts bucket by bucket, so that it finds the sorted boxes in the cache. `layers` (by slot)
  /// is as in Kernels::stage and `masks` as in RowGrid; null where all layers collide.
  void build(const Kernels& kernels, std::span<const geometry::Bounds> bounds, const std::uint8_t* layers,
             const std::uint32_t* masks, std::span<std::uint32_t> slots);
  void clear() noexcept { levels_ = 0; }

  std::span<RowGrid> grids() noexcept { return {grids_.data(), levels_}; }
  std::span<const RowGrid> grids() const noexcept { return {grids_.data(), levels_}; }

 private:
  bool plan_is_stale(std::size_t boxes) const noexcept;
  void plan_level(const Kernels& kernels, std::span<const geometry::Bounds> bounds,
                  std::span<const std::uint32_t> slots, std::size_t level);

  std::array<RowGrid, max_levels> grids_;
  std::size_t levels_ = 0;  ///< grids in use, smallest boxes first
  std::array<SizeLimit, max_levels> limits_{};
  std::array<RowLayout, max_levels> layouts_{};
  std::array<bool, max_levels> laid_out_{};
  std::size_t planned_levels_ = 0;
  std::size_t planned_boxes_ = 0;
  std::size_t planned_larger_ = 0;  ///< boxes larger than the first level at the last plan
  std::size_t larger_ = 0;          ///< boxes larger than the first level in the last build
  std::size_t age_ = 0;             ///< builds since the last plan
  std::vector<geometry::Bounds> sample_;
};

}  // namespace ringfence::broad_phase
