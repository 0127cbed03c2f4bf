#include "broad_phase/kernels.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "broad_phase/kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::uint64_t coordinate_signs = 0x0080808000808080;

// ---- What differs between vectors and none -------------------------------------------------------------------------

#if HWY_TARGET == HWY_SCALAR

constexpr std::size_t lanes() { return 1; }

HWY_INLINE std::uint64_t add_bytes(std::uint64_t p, std::uint64_t q) {
  constexpr std::uint64_t signs = 0x8080808080808080;
  return ((p & ~signs) + (q & ~signs)) ^ ((p ^ q) & signs);
}

// Appends (i, j) for each j in [j, end) whose code meets `query`.
HWY_INLINE std::uint64_t* scan(const std::uint64_t* HWY_RESTRICT codes, std::uint64_t query, std::uint32_t i,
                               std::uint32_t j, std::uint32_t end, std::uint64_t* HWY_RESTRICT out) {
  for (; j < end; ++j) {
    *out = std::uint64_t{j} << 32 | i;
    out += (add_bytes(codes[j], query) & coordinate_signs) == 0;
  }
  return out;
}

HWY_INLINE bool overlap(const GridBox& p, const GridBox& q) {
  return (p.lower[0] <= q.upper[0]) & (q.lower[0] <= p.upper[0]) & (p.lower[1] <= q.upper[1]) &
         (q.lower[1] <= p.upper[1]) & (p.lower[2] <= q.upper[2]) & (q.lower[2] <= p.upper[2]) & (p.slot <= q.guard) &
         (q.slot <= p.guard);
}

HWY_INLINE std::uint64_t mask_of_nonzero(const std::uint8_t* bytes) {
  std::uint64_t mask = 0;
  for (std::size_t k = 0; k < 64; ++k) mask |= std::uint64_t{bytes[k] != 0} << k;
  return mask;
}

#else

using Codes = hn::ScalableTag<std::uint64_t>;
using Corner = hn::FixedTag<std::uint32_t, 4>;

HWY_INLINE std::size_t lanes() { return hn::Lanes(Codes()); }

HWY_INLINE std::uint64_t* scan(const std::uint64_t* HWY_RESTRICT codes, std::uint64_t query, std::uint32_t i,
                               std::uint32_t j, std::uint32_t end, std::uint64_t* HWY_RESTRICT out) {
  const Codes d;
  const hn::Repartition<std::uint8_t, Codes> bytes;
  const std::size_t width = hn::Lanes(d);
  const auto wanted = hn::BitCast(bytes, hn::Set(d, query));
  const auto signs = hn::Set(d, coordinate_signs);
  const auto step = hn::Set(d, std::uint64_t{width} << 32);
  auto pair = hn::Add(hn::ShiftLeft<32>(hn::Iota(d, 0)), hn::Set(d, std::uint64_t{j} << 32 | i));
  // At least once, also where there is nothing left: a branch that is almost never taken costs less than one that
  // sometimes is.
  std::int64_t left = std::int64_t{end} - std::int64_t{j};
  const std::uint64_t* HWY_RESTRICT at = codes + j;
  do {
    const auto sum = hn::BitCast(d, hn::Add(wanted, hn::BitCast(bytes, hn::LoadU(d, at))));
    const auto meets = hn::And(hn::Eq(hn::And(sum, signs), hn::Zero(d)),
                               hn::FirstN(d, static_cast<std::size_t>(std::min<std::int64_t>(left, width))));
    hn::StoreU(hn::Compress(pair, meets), d, out);
    out += hn::CountTrue(d, meets);
    pair = hn::Add(pair, step);
    at += width;
    left -= static_cast<std::int64_t>(width);
  } while (left > 0);
  return out;
}

HWY_INLINE bool overlap(const GridBox& p, const GridBox& q) {
  const Corner d;
  const auto p_upper = hn::Load(d, p.upper);
  const auto q_upper = hn::Load(d, q.upper);
  const auto first = hn::Eq(hn::Max(hn::Load(d, p.lower), q_upper), q_upper);
  const auto second = hn::Eq(hn::Max(hn::Load(d, q.lower), p_upper), p_upper);
  return hn::AllTrue(d, hn::And(first, second));
}

HWY_INLINE std::uint64_t mask_of_nonzero(const std::uint8_t* bytes) {
  const hn::ScalableTag<std::uint8_t> d;
  std::uint8_t bits[8];
  for (std::size_t k = 0; k < 64; k += hn::Lanes(d))
    hn::StoreMaskBits(d, hn::Ne(hn::LoadU(d, bytes + k), hn::Zero(d)), bits + k / 8);
  std::uint64_t mask;
  std::memcpy(&mask, bits, sizeof mask);
  return mask;
}

#endif

// ---- Who moves ------------------------------------------------------------------------------------------------------

HWY_INLINE std::uint32_t* append_bits(std::uint64_t mask, std::uint32_t first, std::uint32_t* out) {
  if (mask == ~std::uint64_t{0}) {
    for (std::uint32_t k = 0; k < 64; ++k) out[k] = first + k;
    return out + 64;
  }
  for (; mask != 0; mask &= mask - 1) *out++ = first + static_cast<std::uint32_t>(std::countr_zero(mask));
  return out;
}

Kernels::Census take_census(std::span<const std::uint8_t> present, std::span<const std::uint8_t> resting,
                            const std::uint8_t* kept, std::uint32_t* moving, std::uint32_t* leaving) {
  std::uint32_t* const first_moving = moving;
  std::uint32_t* const first_leaving = leaving;
  std::size_t pending = 0;
  const auto block = [&](const std::uint8_t* here, const std::uint8_t* still, const std::uint8_t* held,
                         std::uint32_t first) {
    const std::uint64_t is_here = mask_of_nonzero(here), is_still = mask_of_nonzero(still),
                        is_held = mask_of_nonzero(held);
    const std::uint64_t moves = is_here & ~(is_held & is_still);
    moving = append_bits(moves, first, moving);
    leaving = append_bits(is_held & ~is_still, first, leaving);
    pending += static_cast<std::size_t>(std::popcount(moves & is_still));
  };
  const std::size_t n = present.size();
  std::size_t i = 0;
  for (; i + 64 <= n; i += 64) block(present.data() + i, resting.data() + i, kept + i, static_cast<std::uint32_t>(i));
  if (i < n) {
    std::uint8_t tail[3][64] = {};
    std::memcpy(tail[0], present.data() + i, n - i);
    std::memcpy(tail[1], resting.data() + i, n - i);
    std::memcpy(tail[2], kept + i, n - i);
    block(tail[0], tail[1], tail[2], static_cast<std::uint32_t>(i));
  }
  return {static_cast<std::size_t>(moving - first_moving), static_cast<std::size_t>(leaving - first_leaving), pending};
}

// ---- Sorting --------------------------------------------------------------------------------------------------------

std::size_t stage(RowGrid& grid, const geometry::Bounds* bounds, const std::uint32_t* slots, std::size_t count,
                  std::uint32_t* larger) {
  const RowLayout& rows = grid.layout;
  const std::uint32_t sx = rows.cell_shift[0], sy = rows.cell_shift[1], sz = rows.cell_shift[2];
  const std::uint32_t mx = rows.cell_mask[0], my = rows.cell_mask[1], mz = rows.cell_mask[2];
  const std::uint32_t to_y = rows.x_bits, to_z = rows.x_bits + rows.y_bits, bucket_shift = rows.bucket_shift;
  const std::uint32_t ex = rows.limit[0], ey = rows.limit[1], ez = rows.limit[2];
  GridBox* HWY_RESTRICT boxes = grid.boxes.data();
  std::uint32_t* HWY_RESTRICT keys = grid.keys.data();
  std::uint32_t* HWY_RESTRICT cursor = grid.cursor.data();
  std::size_t refused = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t slot = slots[k];
    const geometry::Bounds& b = bounds[slot];
    const std::uint32_t key =
        (b.lower[0] >> sx & mx) | (b.lower[1] >> sy & my) << to_y | (b.lower[2] >> sz & mz) << to_z;
    const bool fits =
        (b.upper[0] - b.lower[0] <= ex) & (b.upper[1] - b.lower[1] <= ey) & (b.upper[2] - b.lower[2] <= ez);
    std::uint32_t& next = cursor[key >> bucket_shift];
    const std::uint32_t at = next;
    keys[at] = key;
    GridBox& box = boxes[at];
    std::memcpy(box.lower, b.lower, sizeof box.lower);
    box.slot = slot;
    std::memcpy(box.upper, b.upper, sizeof box.upper);
    box.guard = GridBox::present;
    next = at + fits;
    larger[refused] = slot;
    refused += !fits;
    if (HWY_UNLIKELY(((at + fits) & (RowGrid::chunk - 1)) == 0) && fits) next = grid.add_chunk(at / RowGrid::chunk);
  }
  return refused;
}

HWY_INLINE std::uint64_t quantise(const GridBox& box, const RowLayout& rows) {
  const auto byte = [](std::uint32_t v, unsigned to) { return std::uint64_t{v & 0xff} << to; };
  return byte(box.upper[0] >> rows.quantum[0], 0) | byte(box.upper[1] >> rows.quantum[1], 8) |
         byte(box.upper[2] >> rows.quantum[2], 16) | byte(0 - (box.lower[0] >> rows.quantum[0]), 32) |
         byte(0 - (box.lower[1] >> rows.quantum[1]), 40) | byte(0 - (box.lower[2] >> rows.quantum[2]), 48);
}

HWY_INLINE std::uint64_t encode(const GridBox& box, const RowLayout& rows) {
  const std::uint32_t cells =
      ((box.upper[0] >> rows.cell_shift[0]) - (box.lower[0] >> rows.cell_shift[0])) & rows.partitioned[0];
  const std::uint32_t row = box.lower[1] >> rows.cell_shift[1];
  const std::uint32_t y = ((box.upper[1] >> rows.cell_shift[1]) - row) & rows.partitioned[1];
  const std::uint32_t before = (row - ((box.lower[1] - rows.limit[1]) >> rows.cell_shift[1])) & rows.partitioned[1] & 1;
  const std::uint32_t z =
      ((box.upper[2] >> rows.cell_shift[2]) - (box.lower[2] >> rows.cell_shift[2])) & rows.partitioned[2];
  const std::uint32_t reach = y | z << 1 | (y & z) << 2 | (before & z) << 3;
  return quantise(box, rows) | std::uint64_t{reach} << 24 | std::uint64_t{cells} << 56;
}

HWY_INLINE std::uint64_t swap_halves(std::uint64_t code) { return code << 32 | code >> 32; }

template <class Visit>
HWY_INLINE void for_each_run(const RowGrid& grid, std::uint32_t bucket, Visit&& visit) {
  const std::uint32_t end = grid.cursor[bucket];
  for (std::uint32_t chunk = grid.first_chunk[bucket];; chunk = grid.next_chunk[chunk]) {
    const std::uint32_t first = chunk * RowGrid::chunk;
    if (end - first < RowGrid::chunk) return visit(first, end);
    visit(first, first + RowGrid::chunk);
  }
}

void sort(RowGrid& grid) {
  const RowLayout& rows = grid.layout;
  std::uint32_t* const cell_end = grid.cell_end.data() + 1;
  cell_end[-1] = 0;
  std::uint32_t sum = 0;
  for (std::uint32_t bucket = 0; bucket < rows.buckets; ++bucket) {
    const std::uint32_t first_key = bucket << rows.bucket_shift;
    const std::uint32_t last_key = std::min(rows.cells, (bucket + 1) << rows.bucket_shift);
    std::memset(cell_end + first_key, 0, (last_key - first_key) * sizeof(std::uint32_t));
    for_each_run(grid, bucket, [&](std::uint32_t first, std::uint32_t last) {
      for (std::uint32_t k = first; k < last; ++k) ++cell_end[grid.keys[k]];
    });
    for (std::uint32_t key = first_key; key < last_key; ++key) {
      const std::uint32_t here = cell_end[key];
      cell_end[key] = sum;
      sum += here;
    }
    for_each_run(grid, bucket, [&](std::uint32_t first, std::uint32_t last) {
      for (std::uint32_t k = first; k < last; ++k) {
        const std::uint32_t key = grid.keys[k];
        const std::uint32_t to = cell_end[key]++;
        grid.codes[to] = encode(grid.boxes[k], rows);
        grid.entries[to] = {k, key};
      }
    });
  }
  grid.count = sum;
}

// ---- Sweeping -------------------------------------------------------------------------------------------------------

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
HWY_INLINE std::uint64_t* scan_cells(const RowGrid& grid, const std::uint32_t* cell_end, std::uint64_t query,
                                     std::uint32_t i, std::uint32_t row_key, CellRange cells, std::uint64_t* out) {
  const std::int32_t mask = static_cast<std::int32_t>(grid.layout.cell_mask[0]);
  const std::uint64_t* codes = grid.codes.data();
  const auto run = [&](std::int32_t first, std::int32_t last) {
    const std::uint32_t* row = cell_end + row_key;
    return scan(codes, query, i, row[first - 1], row[last], out);
  };
  if (HWY_LIKELY(cells.first >= 0 && cells.last <= mask)) return run(cells.first, cells.last);
  if (cells.first < 0) {
    out = run((cells.first & mask), mask);
    return run(0, cells.last);
  }
  out = run(cells.first, mask);
  return run(0, cells.last & mask);
}

void sweep(const RowGrid& grid, std::uint32_t first, std::uint32_t last, PairSink& sink) {
  const RowLayout& rows = grid.layout;
  const std::uint64_t* HWY_RESTRICT codes = grid.codes.data();
  const GridEntry* HWY_RESTRICT entries = grid.entries.data();
  const std::uint32_t* HWY_RESTRICT cell_end = grid.cell_end.data() + 1;
  const std::uint32_t x_mask = rows.cell_mask[0];
  const std::uint32_t row_step = 1u << rows.x_bits, row_field = rows.cell_mask[1] << rows.x_bits;
  const std::uint32_t slab_step = 1u << (rows.x_bits + rows.y_bits), key_mask = rows.cells - 1;
  sink.open(grid.count);
  std::uint64_t* out = sink.candidates.data();
  std::uint64_t* const full = out + PairSink::drain_at;

  const auto row_after = [&](std::uint32_t key) { return (key & ~row_field) | ((key + row_step) & row_field); };
  const auto row_before = [&](std::uint32_t key) { return (key & ~row_field) | ((key - row_step) & row_field); };
  const auto slab_after = [&](std::uint32_t key) { return (key + slab_step) & key_mask; };

  // A box that crosses into a neighbour is put aside, without a branch, and the neighbours are scanned kind by kind:
  // the crossings are too irregular to predict.
  constexpr std::uint32_t block = 512;
  std::uint32_t crossing[4][block];
  for (std::uint32_t begin = first; begin < last; begin += block) {
    const std::uint32_t end = std::min(last, begin + block);
    std::uint32_t crossings[4] = {};
    for (std::uint32_t i = begin; i < end; ++i) {
      const std::uint64_t code = codes[i];
      const std::uint32_t key = entries[i].key;
      const std::uint32_t reach = static_cast<std::uint32_t>(code >> 56);
      const std::uint64_t query = swap_halves(code);
      if (HWY_LIKELY((key & x_mask) + reach <= x_mask)) {
        out = scan(codes, query, i, i + 1, cell_end[key + reach], out);
      } else {
        const std::uint32_t row = key & ~x_mask;
        out = scan(codes, query, i, i + 1, cell_end[row + x_mask], out);
        out = scan(codes, query, i, cell_end[static_cast<std::int64_t>(row) - 1],
                   cell_end[row + ((key + reach) & x_mask)], out);
      }
      for (std::uint32_t k = 0; k < 4; ++k) {
        crossing[k][crossings[k]] = i;
        crossings[k] += static_cast<std::uint32_t>(code >> (24 + k)) & 1;
      }
      if (HWY_UNLIKELY(out > full)) out = drain(grid, grid, out, sink);
    }
    const auto scan_neighbours = [&](std::uint32_t kind, const auto& neighbour) {
      for (std::uint32_t k = 0; k < crossings[kind]; ++k) {
        const std::uint32_t i = crossing[kind][k];
        const std::uint64_t code = codes[i];
        const std::uint32_t key = neighbour(entries[i].key);
        const auto x = static_cast<std::int32_t>(key & x_mask);
        out = scan_cells(grid, cell_end, swap_halves(code), i, key & ~x_mask,
                         {x - static_cast<std::int32_t>(rows.back), x + static_cast<std::int32_t>(code >> 56)}, out);
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

// The cells on one axis in which a box may start that overlaps [lower, upper]: the first, and how many.
struct AxisCells {
  std::uint32_t first, count;
};
HWY_INLINE AxisCells axis_cells(const RowLayout& rows, std::size_t axis, std::uint32_t lower, std::uint32_t upper) {
  if (rows.partitioned[axis] == 0) return {0, 1};
  const std::uint32_t shift = rows.cell_shift[axis], mask = rows.cell_mask[axis];
  const std::uint32_t from = (lower < rows.limit[axis] ? 0 : lower - rows.limit[axis]) >> shift;
  return {from & mask, std::min((upper >> shift) - from, mask) + 1};
}

void query(const RowGrid& a, std::uint32_t first, std::uint32_t last, const RowGrid& b, PairSink& sink) {
  const RowLayout& rows = b.layout;
  const std::uint32_t* HWY_RESTRICT cell_end = b.cell_end.data() + 1;
  sink.open(b.count);
  std::uint64_t* out = sink.candidates.data();
  std::uint64_t* const full = out + PairSink::drain_at;
  const std::uint32_t x_mask = rows.cell_mask[0];
  for (std::uint32_t i = first; i < last; ++i) {
    const GridBox& box = a.boxes[a.entries[i].box];
    const bool fits = (box.upper[0] - box.lower[0] <= rows.limit[0]) & (box.upper[1] - box.lower[1] <= rows.limit[1]) &
                      (box.upper[2] - box.lower[2] <= rows.limit[2]);
    const AxisCells x = axis_cells(rows, 0, box.lower[0], box.upper[0]);
    const AxisCells y = axis_cells(rows, 1, box.lower[1], box.upper[1]);
    const AxisCells z = axis_cells(rows, 2, box.lower[2], box.upper[2]);
    const std::uint64_t sought = swap_halves(quantise(box, rows));
    for (std::uint32_t dz = 0; dz < z.count; ++dz)
      for (std::uint32_t dy = 0; dy < y.count; ++dy) {
        const std::uint32_t row = ((y.first + dy) & rows.cell_mask[1]) << rows.x_bits |
                                  ((z.first + dz) & rows.cell_mask[2]) << (rows.x_bits + rows.y_bits);
        if (fits) {
          out = scan_cells(b, cell_end, sought, i, row,
                           {static_cast<std::int32_t>(x.first), static_cast<std::int32_t>(x.first + x.count - 1)}, out);
        } else {
          // A code says nothing about a box larger than the level's limit, and most of what it covers it meets.
          const auto take = [&](std::uint32_t from, std::uint32_t to) {
            for (std::uint32_t j = cell_end[static_cast<std::int64_t>(row + from) - 1]; j < cell_end[row + to]; ++j)
              *out++ = std::uint64_t{j} << 32 | i;
          };
          const std::uint32_t end = x.first + x.count - 1;
          take(x.first, std::min(end, x_mask));
          if (end > x_mask) take(0, end & x_mask);
        }
      }
    if (HWY_UNLIKELY(out > full)) out = drain(a, b, out, sink);
  }
  drain(a, b, out, sink);
}

Kernels kernels() { return {take_census, stage, sort, sweep, query, lanes()}; }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace ringfence::broad_phase
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::broad_phase {
HWY_EXPORT(kernels);
Kernels choose_kernels() { return HWY_DYNAMIC_DISPATCH(kernels)(); }
}  // namespace ringfence::broad_phase
#endif
