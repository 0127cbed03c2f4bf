#include "broad_phase/crowd_sets.hpp"

#include <algorithm>

namespace ringfence::broad_phase {
namespace {

// Excess is the lowest bit, so that both parts of a crowd are adjacent.
std::uint64_t key_of(std::uint32_t crowd, std::uint32_t slot) noexcept {
  return std::uint64_t{crowd << 1 | crowd >> 31} << 32 | slot;
}
std::uint32_t crowd_of(std::uint64_t key) noexcept { return static_cast<std::uint32_t>(key >> 33); }
bool is_excess(std::uint64_t key) noexcept { return (key >> 32 & 1) != 0; }

void sort_all(const Kernels& kernels, BoxSet& boxes) {
  for (RowGrid& grid : boxes.grids()) {
    while (grid.sorted_buckets < grid.layout.buckets) kernels.sort(grid, grid.sorted_buckets++);
  }
}

}  // namespace

std::size_t CrowdSets::take(std::span<const std::uint32_t> crowds, std::span<std::uint32_t> slots) {
  taken_.clear();
  std::size_t left = 0;
  for (const std::uint32_t slot : slots) {
    if (crowds[slot] == 0) {
      slots[left++] = slot;
    } else {
      taken_.push_back(key_of(crowds[slot], slot));
    }
  }
  return left;
}

// The crowds with the most excess first.
void CrowdSets::list_crowds() {
  std::sort(taken_.begin(), taken_.end());
  crowds_.clear();
  for (std::size_t first = 0; first < taken_.size();) {
    Crowd crowd{first, first, first};
    for (; crowd.end < taken_.size() && crowd_of(taken_[crowd.end]) == crowd_of(taken_[first]); ++crowd.end) {
      crowd.excess += is_excess(taken_[crowd.end]) ? 0 : 1;
    }
    crowds_.push_back(crowd);
    first = crowd.end;
  }
  const auto size = [](const Crowd& crowd) { return crowd.end - crowd.excess; };
  std::sort(crowds_.begin(), crowds_.end(),
            [&](const Crowd& p, const Crowd& q) { return size(p) != size(q) ? size(p) > size(q) : p.first < q.first; });
}

// Of slots_. The grids of an excess part are sorted here, because they are not
// swept.
void CrowdSets::add_part(const Kernels& kernels, std::span<const geometry::Bounds> bounds, const std::uint8_t* layers,
                         const std::uint32_t* masks, std::uint32_t crowd, bool excess) {
  if (slots_.empty()) return;
  if (used_ == parts_.size()) parts_.push_back(std::make_unique<Part>());
  Part& part = *parts_[used_++];
  part.crowd = crowd;
  part.excess = excess;
  part.reach = bounds[slots_[0]];
  for (const std::uint32_t slot : slots_) {
    for (int axis = 0; axis < 3; ++axis) {
      part.reach.lower[axis] = std::min(part.reach.lower[axis], bounds[slot].lower[axis]);
      part.reach.upper[axis] = std::max(part.reach.upper[axis], bounds[slot].upper[axis]);
    }
  }
  const std::size_t count = slots_.size();
  part.boxes.build(kernels, bounds, layers, masks, slots_);
  if (excess) sort_all(kernels, part.boxes);
  // To compare a box of the part with all others costs as much as to look at this many of them.
  constexpr std::size_t looks = 24;
  part.has_near = count * looks >= others_.size();
  if (part.has_near) find_near(part, kernels, bounds, layers, masks);
}

// Many boxes on one spot touch few others. Those are few queries, instead of one for each box of the part.
void CrowdSets::find_near(Part& part, const Kernels& kernels, std::span<const geometry::Bounds> bounds,
                          const std::uint8_t* layers, const std::uint32_t* masks) {
  slots_.clear();
  for (const std::uint32_t slot : others_) {
    if (geometry::touch(bounds[slot], part.reach)) slots_.push_back(slot);
  }
  part.has_near = 2 * slots_.size() <= others_.size();
  if (!part.has_near) return;
  part.near.build(kernels, bounds, layers, masks, slots_);
  sort_all(kernels, part.near);
}

void CrowdSets::build(const Kernels& kernels, std::span<const geometry::Bounds> bounds, const std::uint8_t* layers,
                      const std::uint32_t* masks, std::span<const std::uint32_t> others) {
  used_ = 0;
  others_ = others;
  list_crowds();
  const auto list_slots = [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) slots_.push_back(slot_of(taken_[i]));
  };
  const std::size_t separate = std::min(crowds_.size(), most_crowds);
  for (std::size_t i = 0; i < separate; ++i) {
    const Crowd& crowd = crowds_[i];
    for (const bool excess : {false, true}) {
      slots_.clear();
      list_slots(excess ? crowd.excess : crowd.first, excess ? crowd.end : crowd.excess);
      add_part(kernels, bounds, layers, masks, crowd_of(taken_[crowd.first]), excess);
    }
  }
  slots_.clear();
  for (std::size_t i = separate; i < crowds_.size(); ++i) list_slots(crowds_[i].first, crowds_[i].end);
  rest_is_used_ = !slots_.empty();
  add_part(kernels, bounds, layers, masks, many_crowds, false);
}

}  // namespace ringfence::broad_phase
