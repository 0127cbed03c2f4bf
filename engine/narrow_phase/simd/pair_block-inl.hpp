// Shared by all closed-form kernels: tests candidate pairs in vectors, one pair per lane. Included once for each
// Highway target.
//
// A kernel is a struct with the two kinds and `static LaneContacts<D> test(D, const Lanes<D>&)`, for D of float and of
// double, and optionally `static Mask<D> may_touch(D, const Lanes<D>&)` (pair_filter-inl.hpp).

#if defined(RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL
#undef RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL
#else
#define RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL
#endif

#include <cstddef>

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/simd/pair_double-inl.hpp"
#include "narrow_phase/simd/pair_filter-inl.hpp"
#include "narrow_phase/simd/pair_lists-inl.hpp"
#include "narrow_phase/simd/pair_vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Tests all pairs in float.
template <class K, class Pair>
PairContact* run_in_float(const InputPairs<Pair>& list, PairContact* out, KindCounters& counters) {
  constexpr std::size_t lanes = hn::MaxLanes(hn::CappedTag<float, 16>());
  const std::size_t size = list.size(), rest = size % lanes;
  counters.lanes_filled += size;
  counters.lanes += size - rest;
  if (rest > 0) counters.lanes += with_narrowest(rest, [](auto d) { return hn::MaxLanes(d); });
  if constexpr (Filters<K>) {
    return run_filtered<K>(list, out);
  } else {
    return run_all<K>(list, out);
  }
}

template <class K>
PairContact* run(const KernelInput& input, PairContact* out, KindCounters& counters) {
  if constexpr (K::first == K::second) {
    if (!input.candidates.empty())
      return run_in_float<K>(InputPairs<geometry::CandidatePair>{input, input.candidates}, out, counters);
  }
  return input.in_double ? run_in_double<K>(input, out, counters)
                         : run_in_float<K>(InputPairs<KernelPair>{input, input.pairs}, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
