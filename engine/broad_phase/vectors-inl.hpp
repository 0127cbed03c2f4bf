// What differs between vectors and none: comparing codes, the exact test, masks. Included once for each Highway target.

#if defined(RINGFENCE_BROAD_PHASE_VECTORS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_BROAD_PHASE_VECTORS_INL
#undef RINGFENCE_BROAD_PHASE_VECTORS_INL
#else
#define RINGFENCE_BROAD_PHASE_VECTORS_INL
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include <hwy/highway.h>

#include "broad_phase/row_grid.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// What a box looks for: the code that overlapping boxes' codes meet, and the layers that it collides with.
struct Sought {
  std::uint64_t code;
  std::uint32_t layers;  ///< as bits; unused where all layers collide
};

/// The columns of a grid that the sweep reads.
struct Columns {
  explicit Columns(const RowGrid& grid) : codes(grid.codes.data()), layer_bits(grid.layer_bits.data()) {}
  const std::uint64_t* codes;
  const std::uint32_t* layer_bits;
};

template <bool layered>
HWY_INLINE std::uint32_t layers_sought(const RowGrid& grid, std::uint32_t position) {
  if constexpr (!layered) return 0;
  return grid.layer_masks[std::countr_zero(grid.layer_bits[position])];
}

constexpr std::uint64_t coordinate_signs = 0x0080808000808080;

#if HWY_TARGET == HWY_SCALAR

constexpr std::size_t lanes() { return 1; }

HWY_INLINE std::uint64_t add_bytes(std::uint64_t p, std::uint64_t q) {
  constexpr std::uint64_t signs = 0x8080808080808080;
  return ((p & ~signs) + (q & ~signs)) ^ ((p ^ q) & signs);
}

// Appends (i, j) for each j in [j, end) that meets what is sought.
template <bool layered>
HWY_INLINE std::uint64_t* scan(Columns in, Sought sought, std::uint32_t i, std::uint32_t j, std::uint32_t end,
                               std::uint64_t* HWY_RESTRICT out) {
  for (; j < end; ++j) {
    *out = std::uint64_t{j} << 32 | i;
    bool meets = (add_bytes(in.codes[j], sought.code) & coordinate_signs) == 0;
    if constexpr (layered) meets &= (in.layer_bits[j] & sought.layers) != 0;
    out += meets;
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

template <bool layered>
HWY_INLINE std::uint64_t* scan(Columns in, Sought sought, std::uint32_t i, std::uint32_t j, std::uint32_t end,
                               std::uint64_t* HWY_RESTRICT out) {
  const Codes d;
  const hn::Rebind<std::uint32_t, Codes> bits;
  const hn::Repartition<std::uint8_t, Codes> bytes;
  const std::size_t width = hn::Lanes(d);
  const auto wanted = hn::BitCast(bytes, hn::Set(d, sought.code));
  const auto signs = hn::Set(d, coordinate_signs);
  const auto step = hn::Set(d, std::uint64_t{width} << 32);
  auto pair = hn::Add(hn::ShiftLeft<32>(hn::Iota(d, 0)), hn::Set(d, std::uint64_t{j} << 32 | i));
  // At least once, also where there is nothing left: a branch that is almost never taken costs less than one that
  // sometimes is.
  std::int64_t left = std::int64_t{end} - std::int64_t{j};
  const auto layers = hn::Set(d, std::uint64_t{sought.layers});
  const std::uint64_t* HWY_RESTRICT at = in.codes + j;
  const std::uint32_t* HWY_RESTRICT layer_at = in.layer_bits + j;
  do {
    const auto sum = hn::BitCast(d, hn::Add(wanted, hn::BitCast(bytes, hn::LoadU(d, at))));
    auto meets = hn::Eq(hn::And(sum, signs), hn::Zero(d));
    if constexpr (layered) {
      const auto allowed = hn::And(layers, hn::PromoteTo(d, hn::LoadU(bits, layer_at)));
      meets = hn::AndNot(hn::Eq(allowed, hn::Zero(d)), meets);
      layer_at += width;
    }
    out += store_where(pair, meets, left, out);
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

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
