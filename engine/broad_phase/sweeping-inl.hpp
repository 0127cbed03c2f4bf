// The sweep of a grid's boxes among themselves. Included once for each Highway target.

#if defined(RINGFENCE_BROAD_PHASE_SWEEPING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_BROAD_PHASE_SWEEPING_INL
#undef RINGFENCE_BROAD_PHASE_SWEEPING_INL
#else
#define RINGFENCE_BROAD_PHASE_SWEEPING_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "broad_phase/pair_sink.hpp"
#include "broad_phase/row_grid.hpp"
#include "broad_phase/sorting-inl.hpp"
#include "broad_phase/vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase::HWY_NAMESPACE {

// The exact test on what the codes let through.
HWY_INLINE std::uint64_t* drain(const RowGrid& a, const RowGrid& b, std::uint64_t* end, PairSink& sink) {
  const std::uint64_t* const first = sink.candidates.data();
  geometry::CandidatePair* const out = sink.claim(static_cast<std::size_t>(end - first) + 1);
  geometry::CandidatePair* HWY_RESTRICT to = out;
  const GridEntry* HWY_RESTRICT a_entries = a.entries.data();
  const GridEntry* HWY_RESTRICT b_entries = b.entries.data();
  const GridBox* HWY_RESTRICT a_boxes = a.boxes.data();
  const GridBox* HWY_RESTRICT b_boxes = b.boxes.data();
  for (const std::uint64_t* at = first; at != end; ++at) {
    const std::uint64_t ahead = at[std::min<std::ptrdiff_t>(12, end - at - 1)];
    __builtin_prefetch(a_boxes + a_entries[static_cast<std::uint32_t>(ahead)].box);
    __builtin_prefetch(b_boxes + b_entries[ahead >> 32].box);
    const GridBox& p = a_boxes[a_entries[static_cast<std::uint32_t>(*at)].box];
    const GridBox& q = b_boxes[b_entries[*at >> 32].box];
    *to = {p.slot, q.slot};
    to += overlap(p, q);
  }
  sink.count += static_cast<std::size_t>(to - out);
  return sink.candidates.data();
}

// The cells of one row from `first` to `last`, counted from the row's start; outside the row they wrap.
struct CellRange {
  std::int32_t first, last;
};

// Scans a range of cells of the row that `row_key` starts.
template <bool layered>
HWY_INLINE std::uint64_t* scan_cells(const RowGrid& grid, const std::uint32_t* cell_end, Sought sought, std::uint32_t i,
                                     std::uint32_t row_key, CellRange cells, std::uint64_t* out) {
  const std::int32_t mask = static_cast<std::int32_t>(grid.layout.cell_mask[0]);
  const Columns columns(grid);
  const auto run = [&](std::int32_t first, std::int32_t last) {
    const std::uint32_t* row = cell_end + row_key;
    return scan<layered>(columns, sought, i, row[first - 1], row[last], out);
  };
  if (HWY_LIKELY(cells.first >= 0 && cells.last <= mask)) return run(cells.first, cells.last);
  if (cells.first < 0) {
    out = run((cells.first & mask), mask);
    return run(0, cells.last);
  }
  out = run(cells.first, mask);
  return run(0, cells.last & mask);
}

template <bool layered>
void sweep_where(const RowGrid& grid, std::uint32_t first, std::uint32_t last, PairSink& sink) {
  const RowLayout& rows = grid.layout;
  const std::uint64_t* HWY_RESTRICT codes = grid.codes.data();
  const GridEntry* HWY_RESTRICT entries = grid.entries.data();
  const std::uint32_t* HWY_RESTRICT cell_end = grid.cell_end.data() + 1;
  const std::uint32_t x_mask = rows.cell_mask[0];
  const std::uint32_t row_step = 1u << rows.x_bits, row_field = rows.cell_mask[1] << rows.x_bits;
  const std::uint32_t slab_step = 1u << (rows.x_bits + rows.y_bits), key_mask = rows.cells - 1;
  const Columns columns(grid);
  sink.open(grid.count);
  std::uint64_t* out = sink.candidates.data();
  std::uint64_t* const full = out + PairSink::drain_at;

  const auto row_after = [&](std::uint32_t key) { return (key & ~row_field) | ((key + row_step) & row_field); };
  const auto row_before = [&](std::uint32_t key) { return (key & ~row_field) | ((key - row_step) & row_field); };
  const auto slab_after = [&](std::uint32_t key) { return (key + slab_step) & key_mask; };

  // A box that crosses into a neighbour is put aside, without a branch, and the neighbours are scanned kind by kind:
  // the crossings are too irregular to predict.
  constexpr std::uint32_t block = 512;
  std::uint32_t crossing[block];
  std::uint32_t into[4][block];
  for (std::uint32_t begin = first; begin < last; begin += block) {
    const std::uint32_t end = std::min(last, begin + block);
    std::uint32_t crossings = 0;
    for (std::uint32_t i = begin; i < end; ++i) {
      const std::uint64_t code = codes[i];
      const std::uint32_t key = entries[i].key;
      const std::uint32_t reach = static_cast<std::uint32_t>(code >> 56);
      const Sought sought{swap_halves(code), layers_sought<layered>(grid, i)};
      if (HWY_LIKELY((key & x_mask) + reach <= x_mask)) {
        out = scan<layered>(columns, sought, i, i + 1, cell_end[key + reach], out);
      } else {
        const std::uint32_t row = key & ~x_mask;
        out = scan<layered>(columns, sought, i, i + 1, cell_end[row + x_mask], out);
        out = scan<layered>(columns, sought, i, cell_end[static_cast<std::int64_t>(row) - 1],
                            cell_end[row + ((key + reach) & x_mask)], out);
      }
      crossing[crossings] = i;
      crossings += (code & std::uint64_t{next_row | next_slab} << 24) != 0;
      if (HWY_UNLIKELY(out > full)) out = drain(grid, grid, out, sink);
    }
    std::uint32_t count[4] = {};
    for (std::uint32_t k = 0; k < crossings; ++k) {
      const std::uint32_t i = crossing[k];
      const auto flags = static_cast<std::uint32_t>(codes[i] >> 24);
      const std::uint32_t y = flags & 1, z = flags >> 1 & 1, before = flags >> 2 & 1;
      into[0][count[0]] = into[1][count[1]] = into[2][count[2]] = into[3][count[3]] = i;
      count[0] += y;
      count[1] += z;
      count[2] += y & z;
      count[3] += before & z;
    }
    const auto scan_neighbours = [&](std::uint32_t kind, const auto& neighbour) {
      for (std::uint32_t k = 0; k < count[kind]; ++k) {
        const std::uint32_t i = into[kind][k];
        const std::uint64_t code = codes[i];
        const std::uint32_t key = neighbour(entries[i].key);
        const auto x = static_cast<std::int32_t>(key & x_mask);
        const Sought sought{swap_halves(code), layers_sought<layered>(grid, i)};
        out = scan_cells<layered>(grid, cell_end, sought, i, key & ~x_mask,
                                  {x - static_cast<std::int32_t>(rows.back), x + static_cast<std::int32_t>(code >> 56)},
                                  out);
        if (HWY_UNLIKELY(out > full)) out = drain(grid, grid, out, sink);
      }
    };
    scan_neighbours(0, row_after);
    scan_neighbours(1, slab_after);
    scan_neighbours(2, [&](std::uint32_t key) { return row_after(slab_after(key)); });
    scan_neighbours(3, [&](std::uint32_t key) { return row_before(slab_after(key)); });
    out = drain(grid, grid, out, sink);
  }
}

inline void sweep(const RowGrid& grid, std::uint32_t first, std::uint32_t last, PairSink& sink) {
  grid.layer_masks == nullptr ? sweep_where<false>(grid, first, last, sink)
                              : sweep_where<true>(grid, first, last, sink);
}

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
