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

/// Boxes of any mix of sizes: one RowGrid for each size level that has some.
///
/// Plans its levels and rows from the boxes themselves, and again when they have changed enough or some frames have
/// passed. Allocates when it grows, and not for a plan.
class BoxSet {
 public:
  explicit BoxSet(std::size_t boxes);

  /// Makes the set hold the boxes of `slots`, in place of what it held. Overwrites `slots`. The boxes are staged, not
  /// yet sorted: the sweep does that bucket by bucket, so that it finds them in the cache.
  /// `layers` by slot and `masks` as in RowGrid; both null where all layers collide.
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
  std::size_t planned_larger_ = 0;  ///< boxes beyond the first level when last planned
  std::size_t larger_ = 0;          ///< and in the last build
  std::size_t age_ = 0;             ///< builds since the plan
  std::vector<geometry::Bounds> sample_;
};

}  // namespace ringfence::broad_phase
