// Tests the boxes of one grid against those of another. Included once for each Highway target.

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

#if HWY_TARGET == HWY_SCALAR

// Computes the cells of a grid that a box of another grid can collide with.
class CellRangeFinder {
 public:
  explicit CellRangeFinder(const RowLayout& rows) : rows_(rows) {}

  // Writes the first and the last cell on each axis, not wrapped; 0 on an axis with one cell. Returns whether the box
  // is within the size limit of the grid.
  bool operator()(const GridBox& box, std::uint32_t (&first)[4], std::uint32_t (&last)[4]) const {
    bool fits = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::uint32_t limit = rows_.limit[a];
      first[a] = (std::max(box.lower[a], limit) - limit) >> rows_.cell_shift[a] & rows_.partitioned[a];
      last[a] = box.upper[a] >> rows_.cell_shift[a] & rows_.partitioned[a];
      fits &= box.upper[a] - box.lower[a] <= limit;
    }
    return fits;
  }

 private:
  const RowLayout& rows_;
};

#else

// Computes the cells of a grid that a box of another grid can collide with.
class CellRangeFinder {
 public:
  explicit CellRangeFinder(const RowLayout& rows)
      : shift_(hn::LoadU(Corner(), rows.cell_shift)), partitioned_(hn::LoadU(Corner(), rows.partitioned)) {
    const std::uint32_t limit[4] = {rows.limit[0], rows.limit[1], rows.limit[2], 0xffffffff};
    limit_ = hn::LoadU(Corner(), limit);
  }

  // Writes the first and the last cell on each axis, not wrapped; 0 on an axis with one cell. Returns whether the box
  // is within the size limit of the grid.
  HWY_INLINE bool operator()(const GridBox& box, std::uint32_t (&first)[4], std::uint32_t (&last)[4]) const {
    const Corner d;
    const auto lower = hn::Load(d, box.lower), upper = hn::Load(d, box.upper);
    const auto start = hn::Sub(hn::Max(lower, limit_), limit_);
    hn::StoreU(hn::And(hn::Shr(start, shift_), partitioned_), d, first);
    hn::StoreU(hn::And(hn::Shr(upper, shift_), partitioned_), d, last);
    const auto extent = hn::Sub(upper, lower);
    return hn::AllTrue(d, hn::Eq(hn::Min(extent, limit_), extent));
  }

 private:
  hn::Vec<Corner> shift_, partitioned_, limit_;
};

#endif

// A range of positions to compare with a box of another grid, and the code of that box in this grid's quanta.
struct WindowQuery {
  std::uint64_t code;
  Window window;
};

// Handles boxes above the size limit, for which codes decide nothing, and boxes whose cells wrap around.
template <bool layered>
HWY_NOINLINE std::size_t query_irregular(const RowGrid& b, std::uint32_t i, const GridBox& box, SearchKey search_key,
                                         bool fits, HitList hits, std::size_t found) {
  const RowLayout& rows = b.layout;
  const std::uint32_t* const cell_end = b.cell_end.data() + 1;
  const Neighbourhood cells(rows, box.lower, box.upper);
  const std::uint32_t x_end = cells.x.first + cells.x.count - 1, x_mask = rows.cell_mask[0];
  const auto scan_range = [&](std::uint32_t first, std::uint32_t end) HWY_ATTR {
    if (fits) {
      found = scan<layered>(Columns(b), search_key, {i, first, end}, hits, found);
      return;
    }
    // A large box overlaps most boxes in its cells, so all of them get the exact test.
    for (std::uint32_t j = first; j < end; ++j)
      found = hits.add(found, i, j, !layered || (b.layer_bits[j] & search_key.layers) != 0);
  };
  for (std::uint32_t dz = 0; dz < cells.z.count; ++dz)
    for (std::uint32_t dy = 0; dy < cells.y.count; ++dy) {
      const std::uint32_t* const row = cell_end + cells.row_key(rows, dy, dz);
      scan_range(row[static_cast<std::int64_t>(cells.x.first) - 1], row[std::min(x_end, x_mask)]);
      if (x_end > x_mask) scan_range(row[-1], row[x_end & x_mask]);
    }
  return found;
}

template <bool layered>
void query_where(const RowGrid& a, std::uint32_t first, std::uint32_t last, const RowGrid& b, PairSink& sink) {
  const RowLayout& rows = b.layout;
  const std::uint32_t* HWY_RESTRICT cell_end = b.cell_end.data() + 1;
  const CodeEncoder encode(rows);
  const Columns columns(b);
  sink.open(b.count);
  const HitList hits(sink);
  std::size_t found = 0;
  const auto test_if_full = [&]() HWY_ATTR {
    if (HWY_LIKELY(found <= PairSink::max_untested_hits)) return;
    test_hits(a, b, found, sink);
    found = 0;
  };
  const CellRangeFinder find_cells(rows);
  const std::uint32_t x_mask = rows.cell_mask[0], y_mask = rows.cell_mask[1], z_mask = rows.cell_mask[2];
  const std::uint32_t y_to = rows.x_bits, z_to = rows.x_bits + rows.y_bits;
  // As in the sweep there is no branch on the position of a box: each box writes up to four windows, which are scanned
  // afterwards.
  constexpr std::uint32_t block = 256;
  WindowQuery queries[4 * block];
  for (std::uint32_t begin = first; begin < last; begin += block) {
    const std::uint32_t end = std::min(last, begin + block);
    std::uint32_t count = 0;
    for (std::uint32_t i = begin; i < end; ++i) {
      const GridBox& box = a.boxes[a.entries[i].box];
      std::uint32_t from[4], to[4];
      const bool fits = find_cells(box, from, to);
      const std::uint64_t code = swap_halves(encode.quantise(box));
      if (HWY_UNLIKELY(!fits || (from[0] ^ to[0]) > x_mask)) {
        found = query_irregular<layered>(b, i, box, {code, colliding_layers<layered>(a, i)}, fits, hits, found);
        test_if_full();
        continue;
      }
      // At most two rows and two slabs: each is at least two limits deep, and the range that a box covers is at most
      // that deep.
      const std::uint32_t y[2] = {(from[1] & y_mask) << y_to, (to[1] & y_mask) << y_to};
      const std::uint32_t z[2] = {(from[2] & z_mask) << z_to, (to[2] & z_mask) << z_to};
      const std::uint32_t x_first = from[0] & x_mask, x_last = to[0] & x_mask;
      const std::uint32_t two_rows = from[1] != to[1], two_slabs = from[2] != to[2];
      const auto add_query = [&](std::uint32_t row, std::uint32_t needed) HWY_ATTR {
        queries[count] = {code, {i, cell_end[static_cast<std::int64_t>(row + x_first) - 1], cell_end[row + x_last]}};
        count += needed;
      };
      add_query(y[0] | z[0], 1);
      add_query(y[1] | z[0], two_rows);
      add_query(y[0] | z[1], two_slabs);
      add_query(y[1] | z[1], two_rows & two_slabs);
    }
    for (std::uint32_t k = 0; k < count; ++k) {
      const Window& window = queries[k].window;
      found =
          scan<layered>(columns, {queries[k].code, colliding_layers<layered>(a, window.origin)}, window, hits, found);
      test_if_full();
    }
  }
  test_hits(a, b, found, sink);
}

inline void query(const RowGrid& a, std::uint32_t first, std::uint32_t last, const RowGrid& b, PairSink& sink) {
  a.layer_masks == nullptr ? query_where<false>(a, first, last, b, sink) : query_where<true>(a, first, last, b, sink);
}

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
