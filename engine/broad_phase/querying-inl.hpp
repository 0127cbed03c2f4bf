// The boxes of one grid against those of another. Included once for each Highway target.

#if defined(RINGFENCE_BROAD_PHASE_QUERYING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_BROAD_PHASE_QUERYING_INL
#undef RINGFENCE_BROAD_PHASE_QUERYING_INL
#else
#define RINGFENCE_BROAD_PHASE_QUERYING_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "broad_phase/pair_sink.hpp"
#include "broad_phase/row_grid.hpp"
#include "broad_phase/sweeping-inl.hpp"
#include "broad_phase/vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase::HWY_NAMESPACE {

// What a box of another grid is to be compared with, and what it looks for there.
struct Question {
  Sought sought;
  Window window;
};

// For the boxes that are larger than the limit, of which a code says nothing, or whose cells wrap around.
template <bool layered>
std::size_t query_any(const RowGrid& b, std::uint32_t i, Sought sought, bool fits, const Neighbourhood& near,
                      Finds finds, std::size_t found) {
  const RowLayout& rows = b.layout;
  const std::uint32_t* const cell_end = b.cell_end.data() + 1;
  const std::uint32_t x_end = near.x.first + near.x.count - 1, x_mask = rows.cell_mask[0];
  const auto take = [&](std::uint32_t first, std::uint32_t end) HWY_ATTR {
    if (fits) {
      found = scan<layered>(Columns(b), sought, {i, first, end}, finds, found);
      return;
    }
    // Most of what a large box covers it meets: all of it goes to the exact test.
    for (std::uint32_t j = first; j < end; ++j)
      found = finds.add(found, i, j, !layered || (b.layer_bits[j] & sought.layers) != 0);
  };
  for (std::uint32_t dz = 0; dz < near.z.count; ++dz)
    for (std::uint32_t dy = 0; dy < near.y.count; ++dy) {
      const std::uint32_t* const row = cell_end + near.row_key(rows, dy, dz);
      take(row[static_cast<std::int64_t>(near.x.first) - 1], row[std::min(x_end, x_mask)]);
      if (x_end > x_mask) take(row[-1], row[x_end & x_mask]);
    }
  return found;
}

template <bool layered>
void query_where(const RowGrid& a, std::uint32_t first, std::uint32_t last, const RowGrid& b, PairSink& sink) {
  const RowLayout& rows = b.layout;
  const std::uint32_t* HWY_RESTRICT cell_end = b.cell_end.data() + 1;
  const Encoder encode(rows);
  const Columns columns(b);
  sink.open(b.count);
  const Finds finds(sink);
  std::size_t found = 0;
  const auto drain_full = [&]() HWY_ATTR {
    if (HWY_LIKELY(found <= PairSink::drain_at)) return;
    drain(a, b, found, sink);
    found = 0;
  };
  // As in the sweep, no branch on where a box lies: it fills up to four windows, and those are scanned in a row.
  constexpr std::uint32_t block = 256;
  Question questions[4 * block];
  for (std::uint32_t begin = first; begin < last; begin += block) {
    const std::uint32_t end = std::min(last, begin + block);
    std::uint32_t count = 0;
    for (std::uint32_t i = begin; i < end; ++i) {
      const GridBox& box = a.boxes[a.entries[i].box];
      const bool fits = b.holds(box);
      const Neighbourhood near(rows, box.lower, box.upper);
      const Sought sought{swap_halves(encode.quantise(box)), layers_sought<layered>(a, i)};
      const std::uint32_t x_end = near.x.first + near.x.count - 1;
      if (HWY_UNLIKELY(!fits || x_end > rows.cell_mask[0])) {
        found = query_any<layered>(b, i, sought, fits, near, finds, found);
        drain_full();
        continue;
      }
      // At most two rows and two slabs: they are two limits deep, and so is what is looked at.
      for (std::uint32_t k = 0; k < 4; ++k) {
        const std::uint32_t dy = k & 1, dz = k >> 1;
        const std::uint32_t row = near.row_key(rows, dy, dz);
        questions[count] = {sought,
                            {i, cell_end[static_cast<std::int64_t>(row + near.x.first) - 1], cell_end[row + x_end]}};
        count += (dy < near.y.count) & (dz < near.z.count);
      }
    }
    for (std::uint32_t k = 0; k < count; ++k) {
      found = scan<layered>(columns, questions[k].sought, questions[k].window, finds, found);
      drain_full();
    }
  }
  drain(a, b, found, sink);
}

inline void query(const RowGrid& a, std::uint32_t first, std::uint32_t last, const RowGrid& b, PairSink& sink) {
  a.layer_masks == nullptr ? query_where<false>(a, first, last, b, sink) : query_where<true>(a, first, last, b, sink);
}

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
