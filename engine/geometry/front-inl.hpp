// Moves chosen lanes to the front of a vector. Included once for each Highway target.
//
// Highway 1.0.3 has Compress for this. On AVX2 and SSE4, which have no such instruction, GCC copies its table of 1 KB
// to the stack in each call; and where several vectors are moved, one order for all costs less than to compress each.

#if defined(RINGFENCE_GEOMETRY_FRONT_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_GEOMETRY_FRONT_INL
#undef RINGFENCE_GEOMETRY_FRONT_INL
#else
#define RINGFENCE_GEOMETRY_FRONT_INL
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ringfence::geometry::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_SSE4
/// For each set of eight lanes: the lanes of the set, ascending, then zeros.
struct FrontLanes {
  std::uint8_t of[256][8] = {};

  constexpr FrontLanes() {
    for (unsigned set = 0; set < 256; ++set) {
      std::size_t size = 0;
      for (std::uint8_t lane = 0; lane < 8; ++lane) {
        if ((set >> lane & 1) != 0) of[set][size++] = lane;
      }
    }
  }
};
inline constexpr FrontLanes front_lanes;
#endif

/// The lanes whose bits are set, ascending: of `ids`, which has at most eight. What follows the last is unspecified.
template <class Ids>
HWY_INLINE hn::Vec<Ids> lanes_of_bits(Ids ids, std::uint8_t bits) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_SSE4
  return hn::PromoteTo(ids, hn::LoadU(hn::Rebind<std::uint8_t, Ids>(), front_lanes.of[bits]));
#else
  const std::uint8_t loaded[8] = {bits};
  return hn::Compress(hn::Iota(ids, 0), hn::LoadMaskBits(ids, loaded));
#endif
}

/// The lanes of `mask`, ascending. The vector has lanes of four bytes; what follows the last is unspecified.
template <class D>
HWY_INLINE hn::Vec<hn::RebindToUnsigned<D>> lanes_of([[maybe_unused]] D d, hn::Mask<D> mask) {
  static_assert(sizeof(hn::TFromD<D>) == 4);
  const hn::RebindToUnsigned<D> ids;
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_SSE4
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, mask, bits);
  return lanes_of_bits(ids, bits[0]);
#else
  return hn::Compress(hn::Iota(ids, 0), hn::RebindMask(ids, mask));
#endif
}

/// The order, for TableLookupLanes, that moves the lanes of `mask` to the front.
template <class D>
HWY_INLINE auto front_order(D d, hn::Mask<D> mask) {
  return hn::IndicesFromVec(d, lanes_of(d, mask));
}

}  // namespace ringfence::geometry::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
