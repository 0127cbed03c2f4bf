// Copies boxes into the buckets of a grid. Included once for each Highway target.

#if defined(RINGFENCE_BROAD_PHASE_STAGING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_BROAD_PHASE_STAGING_INL
#undef RINGFENCE_BROAD_PHASE_STAGING_INL
#else
#define RINGFENCE_BROAD_PHASE_STAGING_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/prefetch.hpp"
#include "broad_phase/layers.hpp"
#include "broad_phase/row_grid.hpp"
#include "broad_phase/vectors-inl.hpp"
#include "geometry/bounds.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase::HWY_NAMESPACE {

#if HWY_ARCH_X86_64 && HWY_TARGET <= HWY_AVX3

// One bit extraction for x and y together and one for z; all processors with AVX-512 have a fast one.
class KeyEncoder {
 public:
  explicit KeyEncoder(const RowLayout& rows)
      : x_and_y_(std::uint64_t{rows.cell_mask[0]} << rows.cell_shift[0] | std::uint64_t{rows.cell_mask[1]}
                                                                              << rows.cell_shift[1] << 32),
        z_(rows.cell_mask[2] << rows.cell_shift[2]),
        to_(rows.x_bits + rows.y_bits) {}
  HWY_INLINE std::uint32_t operator()(const geometry::Bounds& b) const {
    std::uint64_t x_and_y;
    std::memcpy(&x_and_y, b.lower, sizeof x_and_y);
    return static_cast<std::uint32_t>(_pext_u64(x_and_y, x_and_y_)) | _pext_u32(b.lower[2], z_) << to_;
  }

 private:
  std::uint64_t x_and_y_;
  std::uint32_t z_, to_;
};

#else

class KeyEncoder {
 public:
  explicit KeyEncoder(const RowLayout& rows) : rows_(rows) {}
  HWY_INLINE std::uint32_t operator()(const geometry::Bounds& b) const {
    const auto cell = [&](std::size_t axis) { return b.lower[axis] >> rows_.cell_shift[axis] & rows_.cell_mask[axis]; };
    return cell(0) | cell(1) << rows_.x_bits | cell(2) << (rows_.x_bits + rows_.y_bits);
  }

 private:
  RowLayout rows_;
};

#endif

#if HWY_TARGET == HWY_SCALAR

class Limit {
 public:
  explicit Limit(const RowLayout& rows) : rows_(rows) {}
  bool contains(const geometry::Bounds& b) const {
    return (b.upper[0] - b.lower[0] <= rows_.limit[0]) & (b.upper[1] - b.lower[1] <= rows_.limit[1]) &
           (b.upper[2] - b.lower[2] <= rows_.limit[2]);
  }

 private:
  RowLayout rows_;
};

HWY_INLINE std::uint32_t copy_if_within(const geometry::Bounds& b, std::uint32_t slot, const Limit& limit,
                                        GridBox& to) {
  std::memcpy(to.lower, b.lower, sizeof to.lower);
  std::memcpy(to.upper, b.upper, sizeof to.upper);
  to.label = slot;
  to.guard = GridBox::guard_of_others;
  return limit.contains(b);
}

#else

class Limit {
 public:
  explicit Limit(const RowLayout& rows) : corner_(hn::FirstN(Corner(), 3)) {
    const std::uint32_t limit[4] = {rows.limit[0], rows.limit[1], rows.limit[2], 0xffffffff};
    limit_ = hn::LoadU(Corner(), limit);
  }
  HWY_INLINE bool contains(hn::Vec<Corner> lower, hn::Vec<Corner> upper) const {
    const auto extent = hn::Sub(upper, lower);
    return hn::AllTrue(Corner(), hn::Eq(hn::Min(extent, limit_), extent));
  }
  HWY_INLINE hn::Vec<Corner> with_fourth(hn::Vec<Corner> corner, std::uint32_t fourth) const {
    return hn::IfThenElse(corner_, corner, hn::Set(Corner(), fourth));
  }

 private:
  hn::Vec<Corner> limit_;
  hn::Mask<Corner> corner_;
};

HWY_INLINE std::uint32_t copy_if_within(const geometry::Bounds& b, std::uint32_t slot, const Limit& limit,
                                        GridBox& to) {
  const Corner d;
  const auto lower = limit.with_fourth(hn::LoadU(d, b.lower), slot);
  const auto upper = limit.with_fourth(hn::Shuffle0321(hn::LoadU(d, b.lower + 2)), GridBox::guard_of_others);
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
  // One store instead of four.
  const hn::FixedTag<std::uint32_t, 8> both;
  hn::Store(hn::Combine(both, upper, lower), both, to.lower);
#else
  hn::Store(lower, d, to.lower);
  hn::Store(upper, d, to.upper);
#endif
  return limit.contains(lower, upper);
}

#endif

// `typed`: `layers` is not null. `layered`: the grid has layer masks.
template <bool typed, bool layered>
std::size_t stage_where(RowGrid& grid, const geometry::Bounds* bounds, const std::uint8_t* layers,
                        const std::uint32_t* slots, std::size_t count, std::uint32_t* larger) {
  const RowLayout& rows = grid.layout;
  const std::uint32_t bucket_shift = rows.bucket_shift;
  const Limit limit(rows);
  GridBox* const boxes = grid.boxes.data();
  std::uint32_t* const keys = grid.keys.data();
  std::uint32_t* const cursor = grid.cursor.data();
  std::uint8_t* const staged_layers = grid.staged_layers.data();
  std::uint32_t* refused = larger;
  const KeyEncoder key_of(rows);
  const auto put = [&](std::uint32_t slot) HWY_ATTR {
    const geometry::Bounds& b = bounds[slot];
    const std::uint32_t key = key_of(b);
    std::uint32_t& next = cursor[key >> bucket_shift];
    const std::uint32_t at = next;
    // Stores retire in order: a store that misses the cache delays all later ones. No other core uses these lines, and
    // prefetching them for writing made the broad phase 1 to 2 % slower.
    base::prefetch_for_read(boxes + at + 3);
    keys[at] = key;
    if constexpr (layered) staged_layers[at] = layers[slot] & layer_number;
    if (HWY_UNLIKELY(!copy_if_within(b, slot, limit, boxes[at]))) {
      *refused++ = slot;
      return;
    }
    if constexpr (typed) {
      const bool fixed = (layers[slot] & fixed_object) != 0;
      boxes[at].label = slot | (fixed ? GridBox::fixed_bit : 0);
      boxes[at].guard = fixed ? GridBox::guard_of_fixed : GridBox::guard_of_others;
    }
    next = at + 1;
    if (HWY_UNLIKELY((next & (RowGrid::chunk - 1)) == 0)) next = grid.add_chunk(at / RowGrid::chunk);
  };
  // Where few of many boxes move, the hardware prefetcher does not predict the next page.
  constexpr std::size_t ahead = 40;
  std::size_t k = 0;
  for (; k + ahead < count; ++k) {
    base::prefetch_for_read(bounds + slots[k + ahead]);
    put(slots[k]);
  }
  for (; k < count; ++k) put(slots[k]);
  return static_cast<std::size_t>(refused - larger);
}

inline std::size_t stage(RowGrid& grid, const geometry::Bounds* bounds, const std::uint8_t* layers,
                         const std::uint32_t* slots, std::size_t count, std::uint32_t* larger) {
  if (layers == nullptr) return stage_where<false, false>(grid, bounds, layers, slots, count, larger);
  return grid.layer_masks == nullptr ? stage_where<true, false>(grid, bounds, layers, slots, count, larger)
                                     : stage_where<true, true>(grid, bounds, layers, slots, count, larger);
}

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
