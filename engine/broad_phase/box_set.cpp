#include "broad_phase/box_set.hpp"

#include <algorithm>

namespace ringfence::broad_phase {
namespace {
constexpr std::size_t sample_size = 4096;
constexpr std::size_t builds_per_plan = 64;  // a plan costs about a tenth of a build
}  // namespace

BoxSet::BoxSet(std::size_t boxes) {
  sample_.reserve(2 * sample_size);
  (void)boxes;
}

bool BoxSet::plan_is_stale(std::size_t boxes) const noexcept {
  return planned_levels_ == 0 || age_ >= builds_per_plan || boxes > planned_boxes_ + planned_boxes_ / 4 ||
         boxes < planned_boxes_ - planned_boxes_ / 4 || larger_ > planned_larger_ + planned_boxes_ / 256 + 16;
}

void BoxSet::plan_level(const Kernels& kernels, std::span<const geometry::Bounds> bounds,
                        std::span<const std::uint32_t> slots, std::size_t level) {
  const SizeLimit& limit = limits_[level];
  const std::size_t stride = std::max<std::size_t>(1, slots.size() / sample_size);
  std::size_t examined = 0;
  sample_.clear();
  for (std::size_t k = 0; k < slots.size() && sample_.size() < sample_.capacity(); k += stride, ++examined) {
    const geometry::Bounds& b = bounds[slots[k]];
    bool fits = true;
    for (int a = 0; a < 3; ++a) fits &= b.upper[a] - b.lower[a] <= limit.extent[a];
    if (fits) sample_.push_back(b);
  }
  if (sample_.empty()) sample_.push_back(bounds[slots[0]]);
  const std::size_t count = std::max<std::size_t>(sample_.size(), slots.size() * sample_.size() / examined);
  layouts_[level] = plan_rows({sample_, count, {limit.extent[0], limit.extent[1], limit.extent[2]}}, kernels.lanes);
  laid_out_[level] = true;
}

void BoxSet::build(const Kernels& kernels, std::span<const geometry::Bounds> bounds, const std::uint8_t* layers,
                   const std::uint32_t* masks, std::span<std::uint32_t> slots) {
  levels_ = 0;
  if (slots.empty()) return;
  if (plan_is_stale(slots.size())) {
    planned_levels_ = plan_levels(bounds, slots, limits_);
    planned_boxes_ = slots.size();
    laid_out_.fill(false);
    age_ = 0;
  }
  std::size_t left = slots.size();
  for (std::size_t level = 0; level < planned_levels_ && left > 0; ++level) {
    // The layout of a level is planned when the level first receives boxes, which may be later than the plan of the
    // levels.
    if (!laid_out_[level]) plan_level(kernels, bounds, slots.first(left), level);
    RowGrid& grid = grids_[levels_];
    grid.open(layouts_[level], left, masks);
    const std::size_t larger = kernels.stage(grid, bounds.data(), layers, slots.data(), left, slots.data());
    grid.staged = static_cast<std::uint32_t>(left - larger);
    left = larger;
    if (level == 0) larger_ = left;
    if (grid.staged != 0) ++levels_;
  }
  if (age_++ == 0) planned_larger_ = larger_;
}

}  // namespace ringfence::broad_phase
