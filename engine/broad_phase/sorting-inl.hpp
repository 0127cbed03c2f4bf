// Sorts a bucket by cell and computes the codes of its boxes. Included once for each Highway target.

#if defined(RINGFENCE_BROAD_PHASE_SORTING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_BROAD_PHASE_SORTING_INL
#undef RINGFENCE_BROAD_PHASE_SORTING_INL
#else
#define RINGFENCE_BROAD_PHASE_SORTING_INL
#endif

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/prefetch.hpp"
#include "broad_phase/row_grid.hpp"
#include "broad_phase/vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase::HWY_NAMESPACE {

// CodeEncoder computes the code of a box, see RowGrid. quantise() leaves bytes 3 and 7 zero; operator() sets them.
#if HWY_TARGET == HWY_SCALAR

class CodeEncoder {
 public:
  explicit CodeEncoder(const RowLayout& rows) : rows_(rows) {}

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

class CodeEncoder {
 public:
  explicit CodeEncoder(const RowLayout& rows)
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
    // Whether the lower corner minus the limit lies in another row: the lowest bit of the difference of the two rows,
    // moved to bit 2.
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

  // The tables for move(): element i is the byte of the vector that becomes byte i of the code; `none` gives 0.
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

// Calls visit(first, last, next) for each range of adjacent boxes of a bucket, in the order of staging. `next`: where
// the next range begins; of the last range, its own end.
template <class Visit>
HWY_INLINE void for_each_run(const RowGrid& grid, std::uint32_t bucket, Visit&& visit) {
  const std::uint32_t end = grid.cursor[bucket];
  for (std::uint32_t chunk = grid.first_chunk[bucket];;) {
    const std::uint32_t first = chunk * RowGrid::chunk;
    if (end - first < RowGrid::chunk) return visit(first, end, end);
    chunk = grid.next_chunk[chunk];
    visit(first, first + RowGrid::chunk, chunk * RowGrid::chunk);
  }
}

inline void sort(RowGrid& grid, std::uint32_t bucket) {
  const RowLayout& rows = grid.layout;
  const CodeEncoder encode(rows);
  std::uint32_t* const cell_end = grid.cell_end.data() + 1;
  const std::uint32_t first_key = bucket << rows.bucket_shift;
  const std::uint32_t last_key = first_key + (1u << rows.bucket_shift);
  std::memset(cell_end + first_key, 0, (last_key - first_key) * sizeof(std::uint32_t));
  // The loop that counts the boxes of each cell also prefetches the memory that the last loop writes.
  std::uint64_t* codes_ahead = grid.codes.data() + grid.count;
  GridEntry* entries_ahead = grid.entries.data() + grid.count;
  for_each_run(grid, bucket, [&](std::uint32_t first, std::uint32_t last, std::uint32_t) {
    for (std::uint32_t k = first; k < last; ++k) {
      if (k % 8 == 0) {
        base::prefetch_for_read(codes_ahead);
        base::prefetch_for_read(entries_ahead);
        codes_ahead += 8;
        entries_ahead += 8;
      }
      ++cell_end[grid.keys[k]];
    }
  });
  const bool layered = grid.layer_masks != nullptr;
  std::uint32_t sum = grid.count;
  for (std::uint32_t key = first_key; key < last_key; ++key) {
    const std::uint32_t here = cell_end[key];
    cell_end[key] = sum;
    sum += here;
  }
  grid.count = sum;
  for_each_run(grid, bucket, [&](std::uint32_t first, std::uint32_t last, std::uint32_t next) {
    constexpr std::uint32_t ahead = 64;  // the hardware prefetcher does not know in which chunk the next boxes are
    const GridBox* HWY_RESTRICT boxes = grid.boxes.data();
    const std::uint32_t* HWY_RESTRICT keys = grid.keys.data();
    std::uint64_t* HWY_RESTRICT codes = grid.codes.data();
    GridEntry* HWY_RESTRICT entries = grid.entries.data();
    const auto put = [&](std::uint32_t k) HWY_ATTR {
      const std::uint32_t key = keys[k];
      const std::uint32_t to = cell_end[key]++;
      codes[to] = encode(boxes[k]);
      entries[to] = {k, key};
      if (layered) grid.layer_bits[to] = 1u << grid.staged_layers[k];
    };
    std::uint32_t k = first;
    for (; k + ahead < last; ++k) {
      base::prefetch_for_read(boxes + k + ahead);
      put(k);
    }
    for (; k < last; ++k) {
      base::prefetch_for_read(boxes + (next + ahead - (last - k)));
      put(k);
    }
  });
}

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
