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

#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3

// Highway 1.0.3 compresses 64-bit lanes through a table that g++ copies to the stack at each call (25 ns a box).
HWY_INLINE std::size_t store_where(hn::Vec<Codes> pair, hn::Mask<Codes> meets, std::int64_t left, std::uint64_t* out) {
  _mm512_storeu_si512(out, _mm512_maskz_compress_epi64(meets.raw, pair.raw));
  // What lies beyond the end comes last, so that it need only not be counted.
  const auto valid = _bzhi_u32(meets.raw, static_cast<unsigned>(std::min<std::int64_t>(left, 8)));
  return static_cast<std::size_t>(_mm_popcnt_u32(valid));
}

#else

// Lane by lane and without a branch: with two to four lanes that is cheaper than Highway's compress (see above).
HWY_INLINE std::size_t store_where(hn::Vec<Codes> pair, hn::Mask<Codes> meets, std::int64_t left, std::uint64_t* out) {
  const Codes d;
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, meets, bits);
  const std::uint64_t first = hn::GetLane(pair);
  std::size_t count = 0;
  for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
    out[count] = first + (std::uint64_t{lane} << 32);
    count += (bits[0] >> lane & 1) & (static_cast<std::int64_t>(lane) < left);
  }
  return count;
}

#endif

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
    out += store_where(pair, hn::Eq(hn::And(sum, signs), hn::Zero(d)), left, out);
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

#if HWY_ARCH_X86_64 && HWY_TARGET <= HWY_AVX3

// One bit extract for x and y together; every processor with AVX-512 has a fast one.
class KeyOf {
 public:
  explicit KeyOf(const RowLayout& rows)
      : x_and_y_(std::uint64_t{rows.cell_mask[0]} << rows.cell_shift[0] | std::uint64_t{rows.cell_mask[1]}
                                                                              << rows.cell_shift[1] << 32),
        shift_(rows.cell_shift[2]),
        mask_(rows.cell_mask[2]),
        to_(rows.x_bits + rows.y_bits) {}
  HWY_INLINE std::uint32_t operator()(const geometry::Bounds& b) const {
    std::uint64_t x_and_y;
    std::memcpy(&x_and_y, b.lower, sizeof x_and_y);
    return static_cast<std::uint32_t>(_pext_u64(x_and_y, x_and_y_)) | (b.lower[2] >> shift_ & mask_) << to_;
  }

 private:
  std::uint64_t x_and_y_;
  std::uint32_t shift_, mask_, to_;
};

#else

class KeyOf {
 public:
  explicit KeyOf(const RowLayout& rows) : rows_(rows) {}
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
  bool holds(const geometry::Bounds& b) const {
    return (b.upper[0] - b.lower[0] <= rows_.limit[0]) & (b.upper[1] - b.lower[1] <= rows_.limit[1]) &
           (b.upper[2] - b.lower[2] <= rows_.limit[2]);
  }

 private:
  RowLayout rows_;
};

HWY_INLINE std::uint32_t copy_if_within(const geometry::Bounds& b, const Limit& limit, GridBox& to) {
  std::memcpy(to.lower, b.lower, sizeof to.lower);
  std::memcpy(to.upper, b.upper, sizeof to.upper);
  return limit.holds(b);
}

#else

class Limit {
 public:
  explicit Limit(const RowLayout& rows) {
    const std::uint32_t limit[4] = {rows.limit[0], rows.limit[1], rows.limit[2], 0xffffffff};
    limit_ = hn::LoadU(Corner(), limit);
  }
  HWY_INLINE bool holds(hn::Vec<Corner> lower, hn::Vec<Corner> upper) const {
    const auto extent = hn::Sub(upper, lower);
    return hn::AllTrue(Corner(), hn::Eq(hn::Min(extent, limit_), extent));
  }

 private:
  hn::Vec<Corner> limit_;
};

// Writes all of `to`; slot and guard are the caller's to overwrite.
HWY_INLINE std::uint32_t copy_if_within(const geometry::Bounds& b, const Limit& limit, GridBox& to) {
  const Corner d;
  const auto lower = hn::LoadU(d, b.lower);                       // and upper x
  const auto upper = hn::Shuffle0321(hn::LoadU(d, b.lower + 2));  // lower z moved behind
  hn::Store(lower, d, to.lower);
  hn::Store(upper, d, to.upper);
  return limit.holds(lower, upper);
}

#endif

std::size_t stage(RowGrid& grid, const geometry::Bounds* bounds, const std::uint32_t* slots, std::size_t count,
                  std::uint32_t* larger) {
  const RowLayout& rows = grid.layout;
  const std::uint32_t bucket_shift = rows.bucket_shift;
  const Limit limit(rows);
  GridBox* HWY_RESTRICT boxes = grid.boxes.data();
  std::uint32_t* HWY_RESTRICT keys = grid.keys.data();
  std::uint32_t* HWY_RESTRICT cursor = grid.cursor.data();
  std::size_t refused = 0;
  const KeyOf key_of(rows);
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t slot = slots[k];
    const geometry::Bounds& b = bounds[slot];
    const std::uint32_t key = key_of(b);
    std::uint32_t& next = cursor[key >> bucket_shift];
    const std::uint32_t at = next;
    // Stores leave in order: one that has to fetch its line holds up all behind it.
    __builtin_prefetch(boxes + at + 6, 1);
    __builtin_prefetch(keys + at + 16, 1);
    keys[at] = key;
    const std::uint32_t fits = copy_if_within(b, limit, boxes[at]);
    boxes[at].slot = slot;
    boxes[at].guard = GridBox::present;
    larger[refused] = slot;
    refused += 1 - fits;
    next = at + fits;
    if (HWY_UNLIKELY(((at + fits) & (RowGrid::chunk - 1)) == 0) && fits != 0)
      next = grid.add_chunk(at / RowGrid::chunk);
  }
  return refused;
}

#if HWY_TARGET == HWY_SCALAR

class Encoder {
 public:
  explicit Encoder(const RowLayout& rows) : rows_(rows) {}

  std::uint64_t quantise(const GridBox& box) const {
    std::uint64_t code = 0;
    for (unsigned axis = 0; axis < 3; ++axis) {
      code |= std::uint64_t{(box.upper[axis] >> rows_.quantum[axis]) & 0xff} << 8 * axis;
      code |= std::uint64_t{(0 - (box.lower[axis] >> rows_.quantum[axis])) & 0xff} << (32 + 8 * axis);
    }
    return code;
  }

  std::uint64_t operator()(const GridBox& box) const {
    const auto cell = [&](std::uint32_t v, std::size_t axis) { return v >> rows_.cell_shift[axis]; };
    std::uint32_t beyond[3];
    for (std::size_t axis = 0; axis < 3; ++axis)
      beyond[axis] = (cell(box.upper[axis], axis) - cell(box.lower[axis], axis)) & rows_.partitioned[axis];
    const std::uint32_t before =
        (cell(box.lower[1], 1) - cell(box.lower[1] - rows_.limit[1], 1)) & rows_.partitioned[1] & 1;
    const std::uint32_t crossing = beyond[1] | beyond[2] << 1 | before << 2;
    return quantise(box) | std::uint64_t{crossing} << 24 | std::uint64_t{beyond[0]} << 56;
  }

 private:
  const RowLayout& rows_;
};

#else

class Encoder {
 public:
  explicit Encoder(const RowLayout& rows)
      : quantum_(hn::LoadU(Corner(), rows.quantum)),
        shift_(hn::LoadU(Corner(), rows.cell_shift)),
        limit_(hn::LoadU(Corner(), rows.limit)),
        partitioned_(hn::LoadU(Corner(), rows.partitioned)) {
    const std::uint32_t y[4] = {0, rows.partitioned[1] & 4, 0, 0};
    before_y_ = hn::LoadU(Corner(), y);
  }

  HWY_INLINE std::uint64_t quantise(const GridBox& box) const {
    const Corner d;
    return pack(code_of(hn::Load(d, box.lower), hn::Load(d, box.upper)));
  }

  HWY_INLINE std::uint64_t operator()(const GridBox& box) const {
    const Corner d;
    const auto lower = hn::Load(d, box.lower), upper = hn::Load(d, box.upper);
    const auto cell = hn::Shr(lower, shift_);
    const auto beyond = hn::And(hn::Sub(hn::Shr(upper, shift_), cell), partitioned_);
    // Whether the row is left at all when the limit is taken off: the lowest bit of the difference, moved to bit 2.
    const auto before = hn::ShiftLeft<2>(hn::Sub(cell, hn::Shr(hn::Sub(lower, limit_), shift_)));
    const auto x_and_y = hn::Or(beyond, hn::And(before, before_y_));
    const auto z = hn::Add(beyond, beyond);
    const auto extra = hn::Or(move(x_and_y, x_and_y_to), move(z, z_to));
    return pack(hn::Or(code_of(lower, upper), extra));
  }

 private:
  using Vector = hn::Vec<Corner>;
  using Bytes = hn::FixedTag<std::uint8_t, 16>;

  static HWY_INLINE Vector move(Vector v, const std::uint8_t (&from)[16]) {
    const Bytes d;
    return hn::BitCast(Corner(), hn::TableLookupBytesOr0(hn::BitCast(d, v), hn::Load(d, from)));
  }
  HWY_INLINE Vector code_of(Vector lower, Vector upper) const {
    const auto negated = hn::Sub(hn::Zero(Corner()), hn::Shr(lower, quantum_));
    return hn::Or(move(hn::Shr(upper, quantum_), upper_to), move(negated, lower_to));
  }
  static HWY_INLINE std::uint64_t pack(Vector v) {
    return hn::GetLane(hn::BitCast(hn::FixedTag<std::uint64_t, 2>(), v));
  }

  static constexpr std::uint8_t none = 0x80;
#define RINGFENCE_REST none, none, none, none, none, none, none, none
  HWY_ALIGN static constexpr std::uint8_t upper_to[16] = {0, 4, 8, none, none, none, none, none, RINGFENCE_REST};
  HWY_ALIGN static constexpr std::uint8_t lower_to[16] = {none, none, none, none, 0, 4, 8, none, RINGFENCE_REST};
  HWY_ALIGN static constexpr std::uint8_t x_and_y_to[16] = {none, none, none, 4, none, none, none, 0, RINGFENCE_REST};
  HWY_ALIGN static constexpr std::uint8_t z_to[16] = {none, none, none, 8, none, none, none, none, RINGFENCE_REST};
#undef RINGFENCE_REST

  Vector quantum_, shift_, limit_, partitioned_, before_y_;
};

#endif

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

void sort(RowGrid& grid, std::uint32_t bucket) {
  const RowLayout& rows = grid.layout;
  const Encoder encode(rows);
  std::uint32_t* const cell_end = grid.cell_end.data() + 1;
  const std::uint32_t first_key = bucket << rows.bucket_shift;
  const std::uint32_t last_key = first_key + (1u << rows.bucket_shift);
  std::memset(cell_end + first_key, 0, (last_key - first_key) * sizeof(std::uint32_t));
  // While counting, fetches what sorting is about to write.
  std::uint64_t* codes_ahead = grid.codes.data() + grid.count;
  GridEntry* entries_ahead = grid.entries.data() + grid.count;
  for_each_run(grid, bucket, [&](std::uint32_t first, std::uint32_t last) {
    for (std::uint32_t k = first; k < last; ++k) {
      if (k % 8 == 0) {
        __builtin_prefetch(codes_ahead, 1);
        __builtin_prefetch(entries_ahead, 1);
        codes_ahead += 8;
        entries_ahead += 8;
      }
      ++cell_end[grid.keys[k]];
    }
  });
  std::uint32_t sum = grid.count;
  for (std::uint32_t key = first_key; key < last_key; ++key) {
    const std::uint32_t here = cell_end[key];
    cell_end[key] = sum;
    sum += here;
  }
  grid.count = sum;
  for_each_run(grid, bucket, [&](std::uint32_t first, std::uint32_t last) {
    const GridBox* HWY_RESTRICT boxes = grid.boxes.data();
    const std::uint32_t* HWY_RESTRICT keys = grid.keys.data();
    std::uint64_t* HWY_RESTRICT codes = grid.codes.data();
    GridEntry* HWY_RESTRICT entries = grid.entries.data();
    for (std::uint32_t k = first; k < last; ++k) {
      const std::uint32_t key = keys[k];
      const std::uint32_t to = cell_end[key]++;
      codes[to] = encode(boxes[k]);
      entries[to] = {k, key};
    }
  });
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
  std::uint32_t crossing[block];
  std::uint32_t into[4][block];
  for (std::uint32_t begin = first; begin < last; begin += block) {
    const std::uint32_t end = std::min(last, begin + block);
    std::uint32_t crossings = 0;
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

// A range of sorted positions to compare with one box's code.
struct Window {
  std::uint64_t sought;
  std::uint32_t asker, first, last;
};

// For the boxes that are larger than the limit, of which a code says nothing, or whose cells wrap around.
std::uint64_t* query_any(const RowGrid& b, std::uint32_t i, std::uint64_t sought, bool fits, const Neighbourhood& near,
                         std::uint64_t* out) {
  const RowLayout& rows = b.layout;
  const std::uint32_t* const cell_end = b.cell_end.data() + 1;
  const std::uint32_t x_end = near.x.first + near.x.count - 1, x_mask = rows.cell_mask[0];
  for (std::uint32_t dz = 0; dz < near.z.count; ++dz)
    for (std::uint32_t dy = 0; dy < near.y.count; ++dy) {
      const std::uint32_t row = near.row_key(rows, dy, dz);
      if (fits) {
        out = scan_cells(b, cell_end, sought, i, row,
                         {static_cast<std::int32_t>(near.x.first), static_cast<std::int32_t>(x_end)}, out);
        continue;
      }
      // Most of what a large box covers it meets: all of it goes to the exact test.
      const auto take = [&](std::uint32_t from, std::uint32_t to) {
        for (std::uint32_t j = cell_end[static_cast<std::int64_t>(row + from) - 1]; j < cell_end[row + to]; ++j)
          *out++ = std::uint64_t{j} << 32 | i;
      };
      take(near.x.first, std::min(x_end, x_mask));
      if (x_end > x_mask) take(0, x_end & x_mask);
    }
  return out;
}

void query(const RowGrid& a, std::uint32_t first, std::uint32_t last, const RowGrid& b, PairSink& sink) {
  const RowLayout& rows = b.layout;
  const std::uint32_t* HWY_RESTRICT cell_end = b.cell_end.data() + 1;
  const Encoder encode(rows);
  sink.open(b.count);
  std::uint64_t* out = sink.candidates.data();
  std::uint64_t* const full = out + PairSink::drain_at;
  // As in the sweep, no branch on where a box lies: it fills up to four windows, and those are scanned in a row.
  constexpr std::uint32_t block = 256;
  Window windows[4 * block];
  for (std::uint32_t begin = first; begin < last; begin += block) {
    const std::uint32_t end = std::min(last, begin + block);
    std::uint32_t count = 0;
    for (std::uint32_t i = begin; i < end; ++i) {
      const GridBox& box = a.boxes[a.entries[i].box];
      const bool fits = b.holds(box);
      const Neighbourhood near(rows, box.lower, box.upper);
      const std::uint64_t sought = swap_halves(encode.quantise(box));
      const std::uint32_t x_end = near.x.first + near.x.count - 1;
      if (HWY_UNLIKELY(!fits || x_end > rows.cell_mask[0])) {
        out = query_any(b, i, sought, fits, near, out);
        if (HWY_UNLIKELY(out > full)) out = drain(a, b, out, sink);
        continue;
      }
      // At most two rows and two slabs: they are two limits deep, and so is what is looked at.
      for (std::uint32_t k = 0; k < 4; ++k) {
        const std::uint32_t dy = k & 1, dz = k >> 1;
        const std::uint32_t row = near.row_key(rows, dy, dz);
        windows[count] = {sought, i, cell_end[static_cast<std::int64_t>(row + near.x.first) - 1],
                          cell_end[row + x_end]};
        count += (dy < near.y.count) & (dz < near.z.count);
      }
    }
    for (std::uint32_t k = 0; k < count; ++k) {
      const Window& w = windows[k];
      out = scan(b.codes.data(), w.sought, w.asker, w.first, w.last, out);
      if (HWY_UNLIKELY(out > full)) out = drain(a, b, out, sink);
    }
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
