// Tests lists of pairs in vectors of float, one pair per lane, for the closed-form kernels. Included once for each
// Highway target.

#if defined(RINGFENCE_NARROW_PHASE_PAIR_VECTORS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PAIR_VECTORS_INL
#undef RINGFENCE_NARROW_PHASE_PAIR_VECTORS_INL
#else
#define RINGFENCE_NARROW_PHASE_PAIR_VECTORS_INL
#endif

#include <algorithm>
#include <cstddef>

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/simd/lane_contacts-inl.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"
#include "narrow_phase/simd/pair_lists-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Tests one vector of pairs and writes the contacts of the first `count`. Not inlined, so that there is one copy of
/// the kernel for all places that call it.
template <class K, class D>
HWY_NOINLINE PairContact* test_one(D d, const PairLanes<D>& pairs, std::size_t count, PairContact* out) {
  return write<K>(d, pairs.ids, count, K::test(d, pairs.in), pairs.in.offset, out);
}

/// Tests two vectors of pairs. Most instructions of a test depend on the one before, and a processor does not look
/// ahead as far as to the next vector, so the compiler mixes the instructions of both: CMakeLists.txt has the option.
template <class K, class D>
HWY_INLINE PairContact* test_two_inlined(D d, const PairLanes<D>* pairs, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const LaneContacts<D> p = K::test(d, pairs[0].in), q = K::test(d, pairs[1].in);
  out = write<K>(d, pairs[0].ids, lanes, p, pairs[0].in.offset, out);
  return write<K>(d, pairs[1].ids, lanes, q, pairs[1].in.offset, out);
}
template <class K, class D>
HWY_NOINLINE PairContact* test_two(D d, const PairLanes<D>* pairs, PairContact* out) {
  return test_two_inlined<K>(d, pairs, out);
}

/// Tests the full vectors of the list.
template <class K, class D, class List>
PairContact* run_full(D d, const List& list, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const std::size_t size = list.size();
  PairLanes<D> in[2];
  std::size_t i = 0;
  for (; i + 2 * lanes <= size; i += 2 * lanes) {
    in[0] = list.template gather_from<K>(d, i);
    in[1] = list.template gather_from<K>(d, i + lanes);
    // Two spheres take so few instructions that the call would cost a tenth.
    if constexpr (K::second == ShapeKind::sphere) {
      out = test_two_inlined<K>(d, in, out);
    } else {
      out = test_two<K>(d, in, out);
    }
  }
  if (i + lanes > size) return out;
  in[0] = list.template gather_from<K>(d, i);
  return test_one<K>(d, in[0], lanes, out);
}

/// The same for pairs that are timed. They are gathered in larger groups, because reading the clock takes as long as
/// gathering a vector.
template <class K, class D, class List>
PairContact* run_timed(D d, const List& list, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d), most = 64 / lanes;
  const std::size_t size = list.size();
  PairLanes<D> in[most];
  for (std::size_t i = 0; i + lanes <= size;) {
    const std::size_t count = std::min((size - i) / lanes, most);
    begin_gathering(list.input);
    for (std::size_t v = 0; v < count; ++v) in[v] = list.template gather_from<K>(d, i + v * lanes);
    end_gathering(list.input);
    for (std::size_t v = 0; v + 1 < count; v += 2) out = test_two<K>(d, in + v, out);
    if (count % 2 != 0) out = test_one<K>(d, in[count - 1], lanes, out);
    i += count * lanes;
  }
  return out;
}

/// Tests the last `count` pairs, fewer than a vector holds.
template <class K, class D, class List>
PairContact* run_rest(D d, const List& list, std::size_t count, PairContact* out) {
  begin_gathering(list.input);
  const PairLanes<D> in = list.template gather_rest<K>(d, list.size() - count);
  end_gathering(list.input);
  return test_one<K>(d, in, count, out);
}

/// Calls `use(d)` with the narrowest vector that holds `rest` pairs.
template <class Use>
HWY_INLINE auto with_narrowest(std::size_t rest, const Use& use) {
  const hn::CappedTag<float, 16> full;
  const hn::CappedTag<float, 8> half;
  const hn::CappedTag<float, 4> quarter;
  if (rest > hn::MaxLanes(half)) return use(full);
  if (rest > hn::MaxLanes(quarter)) return use(half);
  return use(quarter);
}

/// Tests all pairs: full vectors first, then the narrowest vector that holds the rest.
template <class K, class List>
PairContact* run_all(const List& list, PairContact* out) {
  const hn::CappedTag<float, 16> full;
  out = list.input.gather_timer == nullptr ? run_full<K>(full, list, out) : run_timed<K>(full, list, out);
  const std::size_t rest = list.size() % hn::MaxLanes(full);
  if (rest == 0) return out;
  return with_narrowest(rest, [&](auto d) { return run_rest<K>(d, list, rest, out); });
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
