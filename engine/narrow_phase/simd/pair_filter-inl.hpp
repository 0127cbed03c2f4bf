// Tests pairs with the closed-form kernels that first filter them. Included once for each Highway target.
//
// Many candidates do not touch, and a test that finds this out costs much less than a contact. A branch would gain
// nothing, because some lane of a vector nearly always touches, so the pairs that may touch are put together.

#if defined(RINGFENCE_NARROW_PHASE_PAIR_FILTER_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PAIR_FILTER_INL
#undef RINGFENCE_NARROW_PHASE_PAIR_FILTER_INL
#else
#define RINGFENCE_NARROW_PHASE_PAIR_FILTER_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "geometry/front-inl.hpp"
#include "narrow_phase/kernel.hpp"
#include "narrow_phase/simd/pair_lists-inl.hpp"
#include "narrow_phase/simd/pair_vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// A kernel with `may_touch(D, const Lanes<D>&)`: a test that costs much less, and is true for each pair that touches.
template <class K>
concept Filters = requires(hn::CappedTag<float, 16> d, const Lanes<hn::CappedTag<float, 16>>& in) {
  K::may_touch(d, in);
};

/// Lists the indices of those pairs of two vectors that may touch from `to` on, and returns the end of the list; pair i
/// is the first of the first vector. Writes up to one vector past the end.
template <class K, class D>
HWY_INLINE std::uint32_t* list_near(D d, const PairLanes<D>* in, std::size_t i, std::uint32_t* to) {
  const hn::RebindToUnsigned<D> ids;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const auto p = K::may_touch(d, in[0].in), q = K::may_touch(d, in[1].in);
  hn::StoreU(lanes_of(d, p) + hn::Set(ids, static_cast<std::uint32_t>(i)), ids, to);
  to += hn::CountTrue(d, p);
  hn::StoreU(lanes_of(d, q) + hn::Set(ids, static_cast<std::uint32_t>(i + lanes)), ids, to);
  return to + hn::CountTrue(d, q);
}

/// Tests all pairs with a kernel that filters: the pairs that may touch are put together in full vectors before they
/// are tested, a block of pairs at a time.
template <class K, class Pair>
PairContact* run_filtered(const InputPairs<Pair>& pairs, PairContact* out) {
  using D = hn::CappedTag<float, 16>;
  constexpr std::size_t lanes = hn::MaxLanes(D()), two = 2 * lanes, block = 256;
  std::uint32_t
      near[block + 2 * two];  // the rest of the block before, fewer than `two`; a block; what is written past it
  std::uint32_t* end = near;
  std::size_t i = 0;
  bool filter = true;
  while (i + two <= pairs.size()) {
    const std::size_t block_end = i + std::min(block, (pairs.size() - i) / two * two);
    const PairContact* const before = out;
    for (; filter && i < block_end; i += two) {
      begin_gathering(pairs.input);
      const PairLanes<D> in[2] = {pairs.template gather_from<K>(D(), i), pairs.template gather_from<K>(D(), i + lanes)};
      end_gathering(pairs.input);
      end = list_near<K>(D(), in, i, end);
    }
    for (; i < block_end; ++i) *end++ = static_cast<std::uint32_t>(i);
    const std::size_t ready = static_cast<std::size_t>(end - near) / two * two;
    out = run_all<K>(ListedPairs<Pair>{pairs, {near, ready}}, out);
    end = std::copy(near + ready, end, near);
    // The filter takes two fifths of the time of the test, so it is used while more than two fifths of the pairs do not
    // touch.
    filter = static_cast<std::size_t>(out - before) * 5 < block * 3;
  }
  // The last pairs do not fill two vectors.
  for (; i < pairs.size(); ++i) *end++ = static_cast<std::uint32_t>(i);
  return run_all<K>(ListedPairs<Pair>{pairs, {near, end}}, out);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
