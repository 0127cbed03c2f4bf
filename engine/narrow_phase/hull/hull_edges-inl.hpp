// Selects the edges of a polytope by one byte for each of its faces. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_HULL_EDGES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_HULL_EDGES_INL
#undef RINGFENCE_NARROW_PHASE_HULL_EDGES_INL
#else
#define RINGFENCE_NARROW_PHASE_HULL_EDGES_INL
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "narrow_phase/hull/polytope_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Bit `k` in the lanes where `mask` is set; to be combined and stored as bytes.
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

/// The lanes of a mask of at most 64 bytes as bits.
template <class B>
HWY_INLINE std::uint64_t byte_bits(B bytes, hn::Mask<B> mask) {
  std::uint64_t word = 0;
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(bytes, mask, bits);
  std::memcpy(&word, bits, sizeof(word));
  return word;
}

/// Appends `first` plus the index of each set bit to the `count` entries of `out` and returns the new count. May write
/// three entries more.
template <class Index>
HWY_INLINE std::size_t append_bits(std::uint64_t bits, std::size_t first, Index* out, std::size_t count) {
  // Four at a time; entries past the last are overwritten later. Usually one round suffices, so there is no branch to
  // mispredict.
  const std::size_t end = count + static_cast<std::size_t>(std::popcount(bits));
  for (; count < end; count += 4) {
    for (std::size_t k = 0; k < 4; ++k, bits &= bits - 1) {
      out[count + k] = static_cast<Index>(first + static_cast<std::size_t>(std::countr_zero(bits)));
    }
  }
  return end;
}

/// The same for words that often have no bit: without a branch on that. May write four entries more.
template <class Index>
HWY_INLINE std::size_t append_few_bits(std::uint64_t bits, std::size_t first, Index* out, std::size_t count) {
  const std::size_t end = count + static_cast<std::size_t>(std::popcount(bits));
  for (std::size_t k = 0; k < 4; ++k, bits &= bits - 1) {
    out[count + k] = static_cast<Index>(first + static_cast<std::size_t>(std::countr_zero(bits)));
  }
  append_bits(bits, first, out, count + 4);
  return end;
}

/// Entries that append_edges() may write past the last.
inline constexpr std::size_t edge_list_slack = 32;

/// The same for the edges of a hull tested with another hull, of which there are often more than four.
HWY_INLINE std::size_t append_edges(std::uint64_t bits, std::size_t first, std::uint16_t* out, std::size_t count) {
#if HWY_TARGET == HWY_AVX3_DL
  // The indices of all set bits by one instruction.
  const auto added = static_cast<std::size_t>(std::popcount(bits));
  if (HWY_LIKELY(added <= edge_list_slack)) {
    const hn::CappedTag<std::uint8_t, 64> bytes;
    const __m512i indices = _mm512_maskz_compress_epi8(bits, hn::Iota(bytes, 0).raw);
    const __m512i wide = _mm512_cvtepu8_epi16(_mm512_castsi512_si256(indices));
    _mm512_storeu_si512(out + count, _mm512_add_epi16(wide, _mm512_set1_epi16(static_cast<std::int16_t>(first))));
    return count + added;
  }
#endif
  return append_bits(bits, first, out, count);
}

/// Selects an edge unless both of its faces are excluded by the same bit.
struct NoCommonBit {
  HWY_INLINE bool operator()(std::uint8_t left, std::uint8_t right) const { return (left & right) == 0; }
  template <class D>
  HWY_INLINE hn::Mask<D> operator()(D bytes, hn::Vec<D> left, hn::Vec<D> right) const {
    return hn::Eq(hn::And(left, right), hn::Zero(bytes));
  }
};

/// Distance from the column of left faces to that of right faces.
HWY_INLINE std::size_t face_column_stride(const Polytope& own) {
  return (own.edges + geometry::face_column_bytes - 1) / geometry::face_column_bytes * geometry::face_column_bytes;
}

#if HWY_TARGET != HWY_SCALAR
/// Looks up one byte for each index below `size` in a table of max_faces bytes.
template <class B>
HWY_INLINE hn::Vec<B> looked_up(B bytes, const std::uint8_t* table, std::size_t size, hn::Vec<B> index) {
#if HWY_TARGET == HWY_AVX3_DL
  // One instruction instead of fifty with tables of 16 bytes. Bytes past `size` are loaded but never selected.
  if (HWY_LIKELY(size <= 64)) {
    return hn::Vec<B>{_mm512_permutexvar_epi8(index.raw, hn::Load(bytes, table).raw)};
  }
  const auto of_128 = [&](const std::uint8_t* part) HWY_ATTR {
    return _mm512_permutex2var_epi8(hn::Load(bytes, part).raw, index.raw, hn::Load(bytes, part + 64).raw);
  };
  if (size <= 128) return hn::Vec<B>{of_128(table)};
  if (size <= 256) {
    return hn::Vec<B>{_mm512_mask_blend_epi8(_mm512_movepi8_mask(index.raw), of_128(table), of_128(table + 128))};
  }
#endif
  auto out = hn::Zero(bytes);
  // Each index belongs to one table of 16 bytes. In all others its highest bit is set, so that the lookup gives 0.
  for (std::size_t f = 0; f < size; f += 16) {
    const auto from_here = index - hn::Set(bytes, static_cast<std::uint8_t>(f));
    const auto marked = hn::SaturatedAdd(from_here, hn::Set(bytes, std::uint8_t{0x70}));
    const auto valid = hn::And(marked, hn::Set(bytes, std::uint8_t{0x8f}));
    out = hn::Or(out, hn::TableLookupBytesOr0(hn::LoadDup128(bytes, table + f), valid));
  }
  return out;
}
#endif

#if HWY_TARGET != HWY_SCALAR
/// The bytes of the faces to the left and to the right of the edges of a vector.
template <class B>
struct EdgeBytes {
  hn::Vec<B> left, right;

  /// `bytes_of_faces` has max_faces bytes.
  static HWY_INLINE EdgeBytes of(B bytes, const Polytope& own, const std::uint8_t* bytes_of_faces, std::size_t edge) {
    if (HWY_LIKELY(own.faces_of_edges != nullptr)) {
      const std::uint8_t* const left = own.faces_of_edges + edge;
      return {looked_up(bytes, bytes_of_faces, own.faces, hn::Load(bytes, left)),
              looked_up(bytes, bytes_of_faces, own.faces, hn::Load(bytes, left + face_column_stride(own)))};
    }
    // Without columns of bytes, for more than 256 faces. What lies past the last edge is not selected.
    alignas(64) std::uint8_t left[hn::MaxLanes(B())] = {}, right[hn::MaxLanes(B())] = {};
    const std::size_t count = std::min(hn::MaxLanes(B()), own.edges - edge);
    for (std::size_t k = 0; k < count; ++k) {
      left[k] = bytes_of_faces[own.edge[edge + k].left];
      right[k] = bytes_of_faces[own.edge[edge + k].right];
    }
    return {hn::Load(bytes, left), hn::Load(bytes, right)};
  }
};
#endif

/// Calls `visit(bits, i)` with one bit for each of the 64 edges from i on: set if `keep(left, right)` is true for the
/// bytes of its faces.
template <class Keep, class Visit>
HWY_INLINE void select_edges(const Polytope& own, const std::uint8_t* bytes_of_faces, const Keep& keep,
                             const Visit& visit) {
#if HWY_TARGET == HWY_SCALAR
  constexpr std::size_t lanes = 1;
  const auto chosen = [&](std::size_t i) {
    return std::uint64_t{keep(bytes_of_faces[own.edge[i].left], bytes_of_faces[own.edge[i].right])};
  };
#else
  const hn::CappedTag<std::uint8_t, geometry::face_column_bytes> bytes;
  constexpr std::size_t lanes = hn::MaxLanes(bytes);
  const auto chosen = [&](std::size_t i) HWY_ATTR {
    const auto [left, right] = EdgeBytes<std::remove_const_t<decltype(bytes)>>::of(bytes, own, bytes_of_faces, i);
    return byte_bits(bytes, keep(bytes, left, right));
  };
#endif
  for (std::size_t i = 0; i < own.edges; i += 64) {
    std::uint64_t word = chosen(i);
    for (std::size_t k = lanes; k < 64 && i + k < own.edges; k += lanes) word |= chosen(i + k) << k;
    if (own.edges - i < 64) word &= (std::uint64_t{1} << (own.edges - i)) - 1;
    visit(word, i);
  }
}

/// Writes the edges that select_edges() selects, ascending, with `tag` in the upper bits. Returns their number. `out`
/// has room for all edges and edge_list_slack more.
template <class Keep>
HWY_INLINE std::size_t list_edges_where(const Polytope& own, const std::uint8_t* bytes_of_faces, const Keep& keep,
                                        std::uint16_t tag, std::uint16_t* out) {
  std::size_t count = 0;
  select_edges(own, bytes_of_faces, keep,
               [&](std::uint64_t bits, std::size_t i) HWY_ATTR { count = append_edges(bits, tag | i, out, count); });
  return count;
}

/// Writes the edges of a face: first those with the face on their left, with `left_tag` in the upper bits, then those
/// with the face on their right, each group ascending. Returns their number. `out` has room for three more.
template <class Index>
HWY_INLINE std::size_t list_edges_of_face(const Polytope& own, std::size_t face, Index left_tag, Index right_tag,
                                          Index* out) {
  std::size_t count = 0;
#if HWY_TARGET != HWY_SCALAR
  if (own.faces_of_edges != nullptr) {
    const hn::CappedTag<std::uint8_t, geometry::face_column_bytes> bytes;
    const auto wanted = hn::Set(bytes, static_cast<std::uint8_t>(face));
    const auto list = [&](const std::uint8_t* column, Index tag) HWY_ATTR {
      for (std::size_t i = 0; i < own.edges; i += hn::Lanes(bytes)) {
        std::uint64_t bits = byte_bits(bytes, hn::Eq(hn::Load(bytes, column + i), wanted));
        if (own.edges - i < 64) bits &= (std::uint64_t{1} << (own.edges - i)) - 1;
        count = append_bits(bits, tag | i, out, count);
      }
    };
    list(own.faces_of_edges, left_tag);
    list(own.faces_of_edges + face_column_stride(own), right_tag);
    return count;
  }
#endif
  for (std::size_t i = 0; i < own.edges; ++i) {
    if (own.edge[i].left == face) out[count++] = static_cast<Index>(left_tag | i);
  }
  for (std::size_t i = 0; i < own.edges; ++i) {
    if (own.edge[i].right == face) out[count++] = static_cast<Index>(right_tag | i);
  }
  return count;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
