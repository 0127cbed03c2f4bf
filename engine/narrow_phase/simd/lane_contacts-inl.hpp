// Writes the contacts of lanes, for the closed-form kernels. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_LANE_CONTACTS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_LANE_CONTACTS_INL
#undef RINGFENCE_NARROW_PHASE_LANE_CONTACTS_INL
#else
#define RINGFENCE_NARROW_PHASE_LANE_CONTACTS_INL
#endif

#include <cstddef>
#include <cstdint>

#include "geometry/front-inl.hpp"
#include "geometry/rows-inl.hpp"
#include "narrow_phase/kernel.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

using geometry::HWY_NAMESPACE::front_order;
using geometry::HWY_NAMESPACE::lanes_of;

/// PairContact::pair and KernelPair::flipped of each lane.
template <class D>
struct LaneIds {
  hn::Vec<hn::RebindToUnsigned<D>> pair, flipped;
};

#if HWY_TARGET == HWY_SCALAR

template <class D>
HWY_INLINE LaneIds<D> ids_of(D, const KernelPair* pairs) {
  const hn::RebindToUnsigned<D> ids;
  return {hn::Set(ids, pairs->pair), hn::Set(ids, pairs->flipped)};
}

/// Stores the contact of the lane if it hits. `words` are the eight words of a contact.
template <class D>
HWY_INLINE PairContact* store_hits(D d, const hn::Vec<D>* words, hn::Mask<D> hit, PairContact* out) {
  for (int k = 0; k < 8; ++k) hn::Store(words[k], d, reinterpret_cast<float*>(out) + k);
  return out + hn::CountTrue(d, hit);
}

#else

template <class D>
HWY_INLINE LaneIds<D> ids_of(D, const KernelPair* pairs) {
  const hn::RebindToUnsigned<D> ids;
  constexpr std::size_t lanes = hn::MaxLanes(D());
  const std::uint32_t* const words = &pairs->first;
  const auto a = hn::LoadU(ids, words), b = hn::LoadU(ids, words + lanes), c = hn::LoadU(ids, words + 2 * lanes),
             e = hn::LoadU(ids, words + 3 * lanes);
  return {hn::ConcatOdd(ids, hn::ConcatEven(ids, e, c), hn::ConcatEven(ids, b, a)),
          hn::ConcatOdd(ids, hn::ConcatOdd(ids, e, c), hn::ConcatOdd(ids, b, a))};
}

/// Stores one contact of each 128-bit block: the first to `to`, the others 4, 8 and 12 contacts behind it.
template <class D>
HWY_INLINE void store_rows(D d, hn::Vec<D> head, hn::Vec<D> tail, PairContact* to) {
  constexpr std::size_t lanes = hn::MaxLanes(D());
  if constexpr (lanes == 4) {
    hn::StoreU(head, d, reinterpret_cast<float*>(to));
    hn::StoreU(tail, d, reinterpret_cast<float*>(to) + 4);
  } else if constexpr (lanes == 8) {
    hn::StoreU(hn::ConcatLowerLower(d, tail, head), d, reinterpret_cast<float*>(to));
    hn::StoreU(hn::ConcatUpperUpper(d, tail, head), d, reinterpret_cast<float*>(to + 4));
  } else {
    const hn::Half<D> half;
    store_rows(half, hn::LowerHalf(half, head), hn::LowerHalf(half, tail), to);
    store_rows(half, hn::UpperHalf(half, head), hn::UpperHalf(half, tail), to + lanes / 2);
  }
}

#if HWY_TARGET <= HWY_AVX3

/// Stores eight or sixteen contacts to `out`, those of the lanes that hit first. `words` are the eight words of a
/// contact. One permutation of two vectors moves the hits to the front and joins a word with the next, so nothing is
/// compressed.
HWY_INLINE void store_hits_first(hn::FixedTag<float, 16> d, const hn::Vec<hn::FixedTag<float, 16>>* words,
                                 hn::Mask<hn::FixedTag<float, 16>> hit, PairContact* out) {
  using V = hn::Vec<decltype(d)>;
  const hn::RebindToUnsigned<decltype(d)> ids;
  const hn::Repartition<double, decltype(d)> two_words;
  // Contacts 4 q to 4 q + 3 are made of two vectors with a row of four words in each block: `head` has the first
  // halves of 0, 2, 1 and 3, `tail` the second halves of 2, 0, 3 and 1. Every other block of both is contacts 0 and 1.
  alignas(64) static constexpr std::uint32_t head_order[16] = {0, 0, 4, 4, 2, 2, 6, 6, 1, 1, 5, 5, 3, 3, 7, 7};
  alignas(64) static constexpr std::uint32_t tail_order[16] = {2, 2, 6, 6, 0, 0, 4, 4, 3, 3, 7, 7, 1, 1, 5, 5};
  alignas(64) static constexpr std::uint32_t second_word[16] = {0, 16, 0, 16, 0, 16, 0, 16, 0, 16, 0, 16, 0, 16, 0, 16};
  alignas(64) static constexpr std::uint64_t swapped[8] = {2, 3, 8, 9, 6, 7, 12, 13};
  const auto lanes = lanes_of(d, hit);
  const auto order = [&](const std::uint32_t* contact, std::uint32_t first) {
    const auto index = hn::Load(ids, contact) + hn::Set(ids, first);
    return hn::Or(hn::TableLookupLanes(lanes, hn::IndicesFromVec(ids, index)), hn::Load(ids, second_word));
  };
  const auto pick = [](V p, hn::Vec<decltype(ids)> index, V q) {
    return V{_mm512_permutex2var_ps(p.raw, index.raw, q.raw)};
  };
  const std::size_t count = hn::CountTrue(d, hit);
  for (std::uint32_t half = 0; half < 2; ++half) {
    // Where 45 % of the pairs touch, three quarters of the vectors have at most eight hits.
    if (half == 1 && count <= 8) return;
    const auto head_index = order(head_order, 8 * half), tail_index = order(tail_order, 8 * half);
    const auto ab = hn::BitCast(two_words, pick(words[0], head_index, words[1]));
    const auto cd = hn::BitCast(two_words, pick(words[2], head_index, words[3]));
    const auto ef = hn::BitCast(two_words, pick(words[4], tail_index, words[5]));
    const auto gh = hn::BitCast(two_words, pick(words[6], tail_index, words[7]));
    const auto store = [&](hn::Vec<decltype(two_words)> head, hn::Vec<decltype(two_words)> tail, PairContact* to) {
      const auto first = hn::OddEvenBlocks(tail, head);
      const hn::Vec<decltype(two_words)> second{_mm512_permutex2var_pd(
          head.raw, hn::Load(hn::RebindToUnsigned<decltype(two_words)>(), swapped).raw, tail.raw)};
      hn::StoreU(hn::BitCast(d, first), d, reinterpret_cast<float*>(to));
      hn::StoreU(hn::BitCast(d, second), d, reinterpret_cast<float*>(to + 2));
    };
    store(hn::InterleaveLower(two_words, ab, cd), hn::InterleaveLower(two_words, ef, gh), out + 8 * half);
    store(hn::InterleaveUpper(two_words, ab, cd), hn::InterleaveUpper(two_words, ef, gh), out + 8 * half + 4);
  }
}

#endif

/// Stores the contacts of the lanes that hit. `words` are the eight words of a contact.
template <class D>
HWY_INLINE PairContact* store_hits(D d, const hn::Vec<D>* words, hn::Mask<D> hit, PairContact* out) {
#if HWY_TARGET <= HWY_AVX3
  if constexpr (hn::MaxLanes(D()) == 16) {
    store_hits_first(d, words, hit, out);
    return out + hn::CountTrue(d, hit);
  }
#endif
  using geometry::HWY_NAMESPACE::transpose;
  const auto order = front_order(d, hit);
  const auto front = [&](hn::Vec<D> word) { return hn::TableLookupLanes(word, order); };
  hn::Vec<D> head[4], tail[4];
  transpose(d, front(words[0]), front(words[1]), front(words[2]), front(words[3]), head);
  transpose(d, front(words[4]), front(words[5]), front(words[6]), front(words[7]), tail);
  for (std::size_t r = 0; r < 4; ++r) store_rows(d, head[r], tail[r], out + r);
  return out + hn::CountTrue(d, hit);
}

#endif

/// Writes the contacts of the lanes below `count` that hit. Zeros are written as +0, because targets differ in their
/// sign.
template <class K, class D>
HWY_INLINE PairContact* write(D d, const LaneIds<D>& ids, std::size_t count, const LaneContacts<D>& found,
                              const Vector<D>& offset, PairContact* out) {
  const auto zero = hn::Zero(d);
  Vector<D> normal = found.normal, point = found.point;
  if constexpr (K::first != K::second) {
    const auto flip = hn::BitCast(d, ids.flipped);
    const auto sign = hn::BroadcastSignBit(hn::BitCast(hn::RebindToSigned<D>(), ids.flipped));
    const auto flips = hn::MaskFromVec(hn::BitCast(d, sign));
    normal = {hn::Xor(normal.x, flip), hn::Xor(normal.y, flip), hn::Xor(normal.z, flip)};
    point = choose(d, flips, subtract(d, point, offset), point);
  }
  const hn::Mask<D> hit = count < hn::MaxLanes(d) ? hn::And(found.hit, hn::FirstN(d, count)) : found.hit;
  const hn::Vec<D> words[8] = {hn::BitCast(d, ids.pair), hn::Max(found.depth, zero) + zero,
                               normal.x + zero,          normal.y + zero,
                               normal.z + zero,          point.x + zero,
                               point.y + zero,           point.z + zero};
  return store_hits(d, words, hit, out);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
