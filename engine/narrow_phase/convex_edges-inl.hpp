// Which edges of a polytope can matter, by a byte for each of its faces. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_CONVEX_EDGES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_CONVEX_EDGES_INL
#undef RINGFENCE_NARROW_PHASE_CONVEX_EDGES_INL
#else
#define RINGFENCE_NARROW_PHASE_CONVEX_EDGES_INL
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "narrow_phase/convex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Bit `k` where `mask` holds, to be joined with others and stored as bytes.
template <class D>
HWY_INLINE hn::Vec<hn::RebindToSigned<D>> bit_where(D, hn::Mask<D> mask, int k) {
  const hn::RebindToSigned<D> ints;
  return hn::IfThenElseZero(hn::RebindMask(ints, mask), hn::Set(ints, hn::TFromD<decltype(ints)>{1} << k));
}

template <class D>
HWY_INLINE void store_bytes(D ints, hn::Vec<D> values, std::uint8_t* to) {
  if constexpr (sizeof(hn::TFromD<D>) == 4) {
    const hn::Rebind<std::uint8_t, D> bytes;
    hn::StoreU(hn::DemoteTo(bytes, values), bytes, to);
  } else {
    alignas(64) hn::TFromD<D> each[hn::MaxLanes(D())];
    hn::Store(values, ints, each);
    for (std::size_t i = 0; i < hn::MaxLanes(D()); ++i) to[i] = static_cast<std::uint8_t>(each[i]);
  }
}

/// Both faces of an edge may be ruled out by the same of the bits.
struct NotTogether {
  HWY_INLINE bool operator()(std::uint8_t left, std::uint8_t right) const { return (left & right) == 0; }
  template <class D>
  HWY_INLINE hn::Mask<D> operator()(D bytes, hn::Vec<D> left, hn::Vec<D> right) const {
    return hn::Eq(hn::And(left, right), hn::Zero(bytes));
  }
};

/// Writes the edges for whose faces' bytes `keep(left, right)` holds, ascending, with `tag` in their upper bits;
/// answers how many. `out` has room for all edges and three more. `bytes_of_faces` is padded to 16.
template <class Index, class Keep>
HWY_INLINE std::size_t list_edges_where(const Polytope& own, const std::uint8_t* bytes_of_faces, const Keep& keep,
                                        Index tag, Index* out) {
  std::size_t count = 0;
#if HWY_TARGET != HWY_SCALAR
  if (own.faces_of_edges != nullptr) {
    const hn::CappedTag<std::uint8_t, geometry::face_column_bytes> bytes;
    const std::uint8_t* const left = own.faces_of_edges;
    const std::uint8_t* const right = left + (own.edges + geometry::face_column_bytes - 1) /
                                                 geometry::face_column_bytes * geometry::face_column_bytes;
    // With the highest bit set where it is more than 15.
    const auto beyond_15 = [&](hn::Vec<decltype(bytes)> index) HWY_ATTR {
      return hn::Or(index, hn::VecFromMask(bytes, hn::Gt(index, hn::Set(bytes, 15))));
    };
    for (std::size_t i = 0; i < own.edges; i += hn::Lanes(bytes)) {
      const auto l = hn::Load(bytes, left + i), r = hn::Load(bytes, right + i);
      auto of_left = hn::Zero(bytes), of_right = of_left;
      // Tables of 16 bytes: an index is in one of them, and in all others finds nothing.
      for (std::size_t f = 0; f < own.faces; f += 16) {
        const auto table = hn::LoadDup128(bytes, bytes_of_faces + f);
        const auto first = hn::Set(bytes, static_cast<std::uint8_t>(f));
        of_left = hn::Or(of_left, hn::TableLookupBytesOr0(table, beyond_15(l - first)));
        of_right = hn::Or(of_right, hn::TableLookupBytesOr0(table, beyond_15(r - first)));
      }
      std::uint64_t chance = 0;
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(bytes, keep(bytes, of_left, of_right), bits);
      std::memcpy(&chance, bits, sizeof(chance));
      if (own.edges - i < 64) chance &= (std::uint64_t{1} << (own.edges - i)) - 1;
      // Four at a time, those past the last to be overwritten: most often that is all, and no branch to be missed.
      const std::size_t end = count + static_cast<std::size_t>(std::popcount(chance));
      for (; count < end; count += 4) {
        for (std::size_t k = 0; k < 4; ++k, chance &= chance - 1) {
          out[count + k] = static_cast<Index>(tag | (i + static_cast<std::size_t>(std::countr_zero(chance))));
        }
      }
      count = end;
    }
    return count;
  }
#endif
  for (std::size_t i = 0; i < own.edges; ++i) {
    out[count] = static_cast<Index>(tag | i);
    count += keep(bytes_of_faces[own.edge[i].left], bytes_of_faces[own.edge[i].right]);
  }
  return count;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
