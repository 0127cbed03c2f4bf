// Sweeps the boxes of a grid among themselves. Included once for each Highway target.

#if defined(RINGFENCE_BROAD_PHASE_SWEEPING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_BROAD_PHASE_SWEEPING_INL
#undef RINGFENCE_BROAD_PHASE_SWEEPING_INL
#else
#define RINGFENCE_BROAD_PHASE_SWEEPING_INL
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "base/prefetch.hpp"
#include "broad_phase/pair_sink.hpp"
#include "broad_phase/row_grid.hpp"
#include "broad_phase/sorting-inl.hpp"
#include "broad_phase/vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase::HWY_NAMESPACE {

// Runs the exact test on `count` hits and appends the pairs.
inline HWY_NOINLINE void test_hits(const RowGrid& a, const RowGrid& b, std::size_t count, PairSink& sink) {
  std::uint64_t* HWY_RESTRICT hit_positions = sink.hit_positions.data();
  std::uint32_t* HWY_RESTRICT hit_masks = sink.hit_masks.data();
  std::uint64_t* HWY_RESTRICT box_indices = sink.box_indices.data();
  const GridEntry* HWY_RESTRICT a_entries = a.entries.data();
  const GridEntry* HWY_RESTRICT b_entries = b.entries.data();
  const GridBox* HWY_RESTRICT a_boxes = a.boxes.data();
  const GridBox* HWY_RESTRICT b_boxes = b.boxes.data();
  // Each pass takes one box from each hit that has boxes left. Most hits have one box; an inner loop for each hit would
  // mispredict its end.
  while (count != 0) {
    std::size_t left = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const std::uint64_t where = hit_positions[k];
      const std::uint32_t bits = hit_masks[k];
      const std::uint32_t other =
          static_cast<std::uint32_t>(where >> 32) + static_cast<std::uint32_t>(std::countr_zero(bits));
      const std::uint64_t p = a_entries[static_cast<std::uint32_t>(where)].box, q = b_entries[other].box;
      base::prefetch_for_read(a_boxes + p);
      base::prefetch_for_read(b_boxes + q);
      box_indices[k] = q << 32 | p;
      hit_positions[left] = where;
      hit_masks[left] = bits & (bits - 1);
      left += (bits & (bits - 1)) != 0;
    }
    geometry::CandidatePair* const first = sink.claim(count + 1);
    geometry::CandidatePair* HWY_RESTRICT to = first;
    for (std::size_t k = 0; k < count; ++k) {
      const GridBox& p = a_boxes[static_cast<std::uint32_t>(box_indices[k])];
      const GridBox& q = b_boxes[box_indices[k] >> 32];
      *to = {p.slot(), q.slot()};
      to += overlap(p, q);
    }
    if (HWY_UNLIKELY(sink.filters())) to = sink.drop_excluded(first, to);
    sink.count += static_cast<std::size_t>(to - first);
    count = left;
  }
}

// Computes the keys of the rows around a row.
class RowSteps {
 public:
  explicit RowSteps(const RowLayout& rows)
      : row_step_(1u << rows.x_bits),
        row_field_(rows.cell_mask[1] << rows.x_bits),
        slab_step_(1u << (rows.x_bits + rows.y_bits)),
        key_mask_(rows.cells - 1) {}
  /// `rows` is 1 or -1.
  HWY_INLINE std::uint32_t row_beside(std::uint32_t key, std::uint32_t rows) const {
    return (key & ~row_field_) | ((key + rows * row_step_) & row_field_);
  }
  HWY_INLINE std::uint32_t slab_after(std::uint32_t key) const { return (key + slab_step_) & key_mask_; }

 private:
  std::uint32_t row_step_, row_field_, slab_step_, key_mask_;
};

// Adds the windows for the cells `first` to `last` of a row (counted from its start) where the range crosses an end of
// the row and wraps around.
inline Window* add_wrapped(const std::uint32_t* cell_end, std::uint32_t x_mask, std::uint32_t origin,
                           std::uint32_t row_key, std::int32_t first, std::int32_t last, Window* to) {
  const std::uint32_t* const row = cell_end + row_key;
  const auto mask = static_cast<std::int32_t>(x_mask);
  *to++ = {origin, row[(first & mask) - 1], row[mask]};
  *to++ = {origin, row[-1], row[last & mask]};
  return to;
}

// Collects the windows of a block of boxes that lie in neighbour rows.
inline HWY_NOINLINE Window* collect_neighbour_windows(const RowGrid& grid, const std::uint32_t* crossing,
                                                      std::uint32_t count, Window* to) {
  const RowLayout& rows = grid.layout;
  const RowSteps steps(rows);
  const std::uint64_t* HWY_RESTRICT codes = grid.codes.data();
  const GridEntry* HWY_RESTRICT entries = grid.entries.data();
  const std::uint32_t* HWY_RESTRICT cell_end = grid.cell_end.data() + 1;
  const std::uint32_t x_mask = rows.cell_mask[0];
  const auto back = static_cast<std::int32_t>(rows.back);
  for (std::uint32_t k = 0; k < count; ++k) {
    const std::uint32_t i = crossing[k];
    const std::uint64_t code = codes[i];
    const std::uint32_t key = entries[i].key;
    const auto flags = static_cast<std::uint32_t>(code >> 24);
    const std::uint32_t y = flags & 1, z = flags >> 1 & 1, before = flags >> 2 & 1;
    const auto x = static_cast<std::int32_t>(key & x_mask);
    const std::int32_t first = x - back, last = x + static_cast<std::int32_t>(code >> 56);
    const std::uint32_t own = key & ~x_mask, slab = steps.slab_after(own);
    // A box that boxes of the previous row may reach ends within its own row: rows are two limits deep.
    const std::uint32_t row[3] = {steps.row_beside(own, 1), slab, steps.row_beside(slab, 1 - 2 * before)};
    const std::uint32_t needed[3] = {y, z, (y | before) & z};
    if (HWY_UNLIKELY(first < 0 || last > static_cast<std::int32_t>(x_mask))) {
      for (int r = 0; r < 3; ++r)
        if (needed[r] != 0) to = add_wrapped(cell_end, x_mask, i, row[r], first, last, to);
      continue;
    }
    for (int r = 0; r < 3; ++r) {
      *to = {i, cell_end[static_cast<std::int64_t>(row[r]) + first - 1],
             cell_end[static_cast<std::int64_t>(row[r]) + last]};
      to += needed[r];
    }
  }
  return to;
}

template <bool layered>
void sweep_where(const RowGrid& grid, std::uint32_t first, std::uint32_t last, PairSink& sink) {
  const std::uint64_t* HWY_RESTRICT codes = grid.codes.data();
  const GridEntry* HWY_RESTRICT entries = grid.entries.data();
  const std::uint32_t* HWY_RESTRICT cell_end = grid.cell_end.data() + 1;
  const std::uint32_t x_mask = grid.layout.cell_mask[0];
  const Columns columns(grid);
  sink.open(grid.count);
  const HitList hits(sink);
  std::size_t found = 0;
  const auto test_if_full = [&]() HWY_ATTR {
    if (HWY_LIKELY(found <= PairSink::max_untested_hits)) return;
    test_hits(grid, grid, found, sink);
    found = 0;
  };
  std::uint32_t* HWY_RESTRICT crossing = sink.crossing.data();
  Window* const windows = sink.windows.data();
  constexpr std::uint32_t block = PairSink::block;
  for (std::uint32_t begin = first; begin < last; begin += block) {
    const std::uint32_t end = std::min(last, begin + block);
    std::uint32_t crossings = 0;
    Window* windows_end = windows;
    for (std::uint32_t i = begin; i < end; ++i) {
      const std::uint64_t code = codes[i];
      const std::uint32_t key = entries[i].key;
      std::uint32_t ahead = key + static_cast<std::uint32_t>(code >> 56);
      if (HWY_UNLIKELY((key ^ ahead) > x_mask)) {
        const std::uint32_t row = key & ~x_mask;
        *windows_end++ = {i, cell_end[static_cast<std::int64_t>(row) - 1], cell_end[row + (ahead & x_mask)]};
        ahead = row + x_mask;
      }
      const SearchKey search_key{swap_halves(code), colliding_layers<layered>(grid, i)};
      found = scan<layered>(columns, search_key, {i, i + 1, cell_end[ahead]}, hits, found);
      crossing[crossings] = i;
      crossings += (code & std::uint64_t{next_row | next_slab} << 24) != 0;
      test_if_full();
    }
    windows_end = collect_neighbour_windows(grid, crossing, crossings, windows_end);
    for (const Window* w = windows; w != windows_end; ++w) {
      const SearchKey search_key{swap_halves(codes[w->origin]), colliding_layers<layered>(grid, w->origin)};
      found = scan<layered>(columns, search_key, *w, hits, found);
      test_if_full();
    }
    test_hits(grid, grid, found, sink);
    found = 0;
  }
}

inline void sweep(const RowGrid& grid, std::uint32_t first, std::uint32_t last, PairSink& sink) {
  grid.layer_masks == nullptr ? sweep_where<false>(grid, first, last, sink)
                              : sweep_where<true>(grid, first, last, sink);
}

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
