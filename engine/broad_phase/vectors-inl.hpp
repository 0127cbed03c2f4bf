// The operations that differ between vector and scalar targets: comparing codes, the exact test, masks. Included once
// for each Highway target.

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

#include "broad_phase/pair_sink.hpp"
#include "broad_phase/row_grid.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// What a box searches for: its code with the halves swapped, and the layers that it collides with.
struct SearchKey {
  std::uint64_t code;
  std::uint32_t layers;  ///< bit mask; unused where all layers collide
};

/// The columns of a grid that the sweep reads.
struct Columns {
  explicit Columns(const RowGrid& grid) : codes(grid.codes.data()), layer_bits(grid.layer_bits.data()) {}
  const std::uint64_t* codes;
  const std::uint32_t* layer_bits;
};

template <bool layered>
HWY_INLINE std::uint32_t colliding_layers(const RowGrid& grid, std::uint32_t position) {
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

constexpr std::uint32_t scan_width = 8;

template <bool layered>
HWY_INLINE std::uint32_t compare_codes(Columns in, SearchKey search_key, std::uint32_t j) {
  std::uint32_t bits = 0;
  for (std::uint32_t k = 0; k < scan_width; ++k) {
    bool matches = (add_bytes(in.codes[j + k], search_key.code) & coordinate_signs) == 0;
    if constexpr (layered) matches &= (in.layer_bits[j + k] & search_key.layers) != 0;
    bits |= std::uint32_t{matches} << k;
  }
  return bits;
}

HWY_INLINE bool overlap(const GridBox& p, const GridBox& q) {
  return (p.lower[0] <= q.upper[0]) & (q.lower[0] <= p.upper[0]) & (p.lower[1] <= q.upper[1]) &
         (q.lower[1] <= p.upper[1]) & (p.lower[2] <= q.upper[2]) & (q.lower[2] <= p.upper[2]) & (p.label <= q.guard) &
         (q.label <= p.guard);
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

// Of the windows of a world with crowds, one in eight has 9 to 16 boxes, and one in 160 has more: with half this width
// the branch of scan() would be hard to predict.
constexpr std::uint32_t scan_width = 16;

// One instruction each, where Highway 1.0.3 with g++ emits two and goes through memory.
HWY_INLINE hn::Mask<Codes> none_of(hn::Vec<Codes> v, hn::Vec<Codes> bits) {
  return hn::Mask<Codes>{_mm512_testn_epi64_mask(v.raw, bits.raw)};
}
HWY_INLINE std::uint32_t bits_of(hn::Mask<Codes> mask) { return _cvtmask8_u32(mask.raw); }

#else

constexpr std::uint32_t scan_width = 8;

HWY_INLINE hn::Mask<Codes> none_of(hn::Vec<Codes> v, hn::Vec<Codes> bits) {
  return hn::Eq(hn::And(v, bits), hn::Zero(Codes()));
}
HWY_INLINE std::uint32_t bits_of(hn::Mask<Codes> mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(Codes(), mask, bits);
  return bits[0];
}

#endif

// Bit mask of those of the `scan_width` boxes from position j on that match the key.
template <bool layered>
HWY_INLINE std::uint32_t compare_codes(Columns in, SearchKey search_key, std::uint32_t j) {
  const Codes d;
  const hn::Rebind<std::uint32_t, Codes> bits;
  const hn::Repartition<std::uint8_t, Codes> bytes;
  const auto key_bytes = hn::BitCast(bytes, hn::Set(d, search_key.code));
  const auto signs = hn::Set(d, coordinate_signs);
  const auto layers = hn::Set(d, std::uint64_t{search_key.layers});
  std::uint32_t found = 0;
  for (std::uint32_t k = 0; k < scan_width; k += static_cast<std::uint32_t>(hn::Lanes(d))) {
    const auto sum = hn::BitCast(d, hn::Add(key_bytes, hn::BitCast(bytes, hn::LoadU(d, in.codes + j + k))));
    auto matches = none_of(sum, signs);
    if constexpr (layered) {
      const auto allowed = hn::And(layers, hn::PromoteTo(d, hn::LoadU(bits, in.layer_bits + j + k)));
      matches = hn::AndNot(hn::Eq(allowed, hn::Zero(d)), matches);
    }
    found |= bits_of(matches) << k;
  }
  return found;
}

#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3

HWY_INLINE bool overlap(const GridBox& p, const GridBox& q) {
  const auto load = [](const std::uint32_t* from) HWY_ATTR { return hn::Load(Corner(), from).raw; };
  const __mmask8 first = _mm_cmple_epu32_mask(load(p.lower), load(q.upper));
  return _mm_mask_cmple_epu32_mask(first, load(q.lower), load(p.upper)) == 0xf;
}

#else

HWY_INLINE bool overlap(const GridBox& p, const GridBox& q) {
  const Corner d;
  const auto p_upper = hn::Load(d, p.upper);
  const auto q_upper = hn::Load(d, q.upper);
  const auto first = hn::Eq(hn::Max(hn::Load(d, p.lower), q_upper), q_upper);
  const auto second = hn::Eq(hn::Max(hn::Load(d, q.lower), p_upper), p_upper);
  return hn::AllTrue(d, hn::And(first, second));
}

#endif

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

// Where scans append their hits; see PairSink.
struct HitList {
  explicit HitList(PairSink& sink) : hit_positions(sink.hit_positions.data()), hit_masks(sink.hit_masks.data()) {}
  std::uint64_t* HWY_RESTRICT hit_positions;
  std::uint32_t* HWY_RESTRICT hit_masks;

  // Appends a hit if any bit is set, without a branch.
  HWY_INLINE std::size_t add(std::size_t count, std::uint32_t origin, std::uint32_t first, std::uint32_t bits) const {
    hit_positions[count] = std::uint64_t{first} << 32 | origin;
    hit_masks[count] = bits;
    return count + (bits != 0);
  }
};

// Compares the boxes of a window with the key, appends the hits, and returns the new number of hits. Precondition:
// first <= end.
template <bool layered>
HWY_INLINE std::size_t scan(Columns in, SearchKey search_key, Window window, HitList to, std::size_t count) {
  // Compares at least one vector, even for an empty window: a branch that is almost never taken is cheaper than one
  // that is sometimes taken.
  std::uint32_t at = window.first;
  for (std::uint32_t left = window.end - at; HWY_UNLIKELY(left > scan_width); left -= scan_width, at += scan_width)
    count = to.add(count, window.origin, at, compare_codes<layered>(in, search_key, at));
  const std::uint32_t within = (1u << (window.end - at)) - 1;
  return to.add(count, window.origin, at, compare_codes<layered>(in, search_key, at) & within);
}

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
