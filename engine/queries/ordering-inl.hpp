// The order of the boxes of a BoxTree. Included once for each Highway target.

#if defined(RINGFENCE_QUERIES_ORDERING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_QUERIES_ORDERING_INL
#undef RINGFENCE_QUERIES_ORDERING_INL
#else
#define RINGFENCE_QUERIES_ORDERING_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "queries/tree_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::queries::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Words = hn::ScalableTag<std::uint32_t>;
using Word = hn::Vec<Words>;

// The lowest ten bits, with two bits of 0 between any two.
HWY_INLINE Word spread(Word bits) {
  const Words d;
  bits = hn::And(hn::Or(bits, hn::ShiftLeft<16>(bits)), hn::Set(d, 0x030000ffu));
  bits = hn::And(hn::Or(bits, hn::ShiftLeft<8>(bits)), hn::Set(d, 0x0300f00fu));
  bits = hn::And(hn::Or(bits, hn::ShiftLeft<4>(bits)), hn::Set(d, 0x030c30c3u));
  return hn::And(hn::Or(bits, hn::ShiftLeft<2>(bits)), hn::Set(d, 0x09249249u));
}

// All bits of a lane if the given bit of it is set, else none.
HWY_INLINE Word all_if(Word x, std::uint32_t bit) {
  const Words d;
  return hn::VecFromMask(d, hn::TestBit(x, hn::Set(d, bit)));
}

// Places on a Hilbert curve through 2^30 cells, from coordinates of ten bits (Skilling 2004).
HWY_INLINE Word hilbert(Word x, Word y, Word z) {
  const Words d;
  constexpr std::uint32_t top = 1u << (curve_bits - 1);
  for (std::uint32_t bit = top; bit > 1; bit >>= 1) {
    const Word low = hn::Set(d, bit - 1);
    x = hn::Xor(x, hn::And(low, all_if(x, bit)));
    for (Word* other : {&y, &z}) {
      const Word set = all_if(*other, bit);
      const Word swapped = hn::AndNot(set, hn::And(hn::Xor(x, *other), low));
      x = hn::Xor(x, hn::Or(swapped, hn::And(low, set)));
      *other = hn::Xor(*other, swapped);
    }
  }
  y = hn::Xor(y, x);
  z = hn::Xor(z, y);
  Word turned = hn::Zero(d);
  for (std::uint32_t bit = top; bit > 1; bit >>= 1) {
    turned = hn::Xor(turned, hn::And(hn::Set(d, bit - 1), all_if(z, bit)));
  }
  return hn::Or(hn::Or(hn::ShiftLeft<2>(spread(hn::Xor(x, turned))), hn::ShiftLeft<1>(spread(hn::Xor(y, turned)))),
                spread(hn::Xor(z, turned)));
}

inline void curve_places(const std::uint32_t (*cells)[curve_block], std::uint32_t* places) {
  const Words d;
  for (std::size_t i = 0; i < curve_block; i += hn::Lanes(d)) {
    const Word place = hilbert(hn::Load(d, cells[0] + i), hn::Load(d, cells[1] + i), hn::Load(d, cells[2] + i));
    hn::Store(place, d, places + i);
  }
}

}  // namespace ringfence::queries::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
