// The lists of pairs that a closed-form kernel tests. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_PAIR_LISTS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PAIR_LISTS_INL
#undef RINGFENCE_NARROW_PHASE_PAIR_LISTS_INL
#else
#define RINGFENCE_NARROW_PHASE_PAIR_LISTS_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/simd/lane_contacts-inl.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"
#include "narrow_phase/simd/pair_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// What the test of one vector of pairs needs.
template <class D>
struct PairLanes {
  Lanes<D> in;
  LaneIds<D> ids;
};

/// The pairs of an input: KernelInput::pairs or candidates.
template <class Pair>
struct InputPairs {
  const KernelInput& input;
  std::span<const Pair> pairs;

  std::size_t size() const { return pairs.size(); }

  /// Gathers as many pairs as `d` has lanes, from pair i on.
  template <class K, class D>
  HWY_INLINE PairLanes<D> gather_from(D d, std::size_t i) const {
    return gather_at<K>(d, pairs.data() + i, i);
  }

  /// The same for the pairs from i to the end, fewer than `d` has lanes. The other lanes repeat the last pair.
  template <class K, class D>
  HWY_INLINE PairLanes<D> gather_rest(D d, std::size_t i) const {
    constexpr std::size_t lanes = hn::MaxLanes(D());
    Pair padded[lanes];
    for (std::size_t lane = 0; lane < lanes; ++lane) padded[lane] = pairs[std::min(i + lane, pairs.size() - 1)];
    return gather_at<K>(d, padded, i);
  }

 private:
  template <class K, class D>
  HWY_INLINE PairLanes<D> gather_at(D d, const Pair* at, std::size_t i) const {
    const AdjacentPairs<Pair> pair_of{at};
    if constexpr (std::is_same_v<Pair, KernelPair>) {
      return {gather<K>(d, input, pair_of), ids_of(d, at)};
    } else {
      // The numbers are added to a constant: Iota of a variable stores each lane to memory, and the load of the vector
      // would wait for these stores.
      const hn::RebindToUnsigned<D> ids;
      const auto first = hn::Set(ids, input.first_candidate + static_cast<std::uint32_t>(i));
      return {gather<K>(d, input, pair_of), {hn::Iota(ids, 0) + first, hn::Zero(ids)}};
    }
  }
};

/// Pairs of an input, chosen by their indices.
template <class Pair>
struct ListedPairs {
  const InputPairs<Pair>& all;
  std::span<const std::uint32_t> indices;
  const KernelInput& input = all.input;

  std::size_t size() const { return indices.size(); }

  template <class K, class D>
  HWY_INLINE PairLanes<D> gather_from(D d, std::size_t i) const {
    return gather_at<K>(d, indices.data() + i);
  }

  template <class K, class D>
  HWY_INLINE PairLanes<D> gather_rest(D d, std::size_t i) const {
    constexpr std::size_t lanes = hn::MaxLanes(D());
    std::uint32_t padded[lanes];
    for (std::size_t lane = 0; lane < lanes; ++lane) padded[lane] = indices[std::min(i + lane, indices.size() - 1)];
    return gather_at<K>(d, padded);
  }

 private:
  template <class K, class D>
  HWY_INLINE PairLanes<D> gather_at(D d, const std::uint32_t* at) const {
    const Pair* const pairs = all.pairs.data();
    const auto pair_of = [=](std::size_t lane) -> const Pair& { return pairs[at[lane]]; };
    if constexpr (std::is_same_v<Pair, KernelPair>) {
      return {gather<K>(d, input, pair_of), listed_ids(d, pair_of)};
    } else {
      const hn::RebindToUnsigned<D> ids;
      return {gather<K>(d, input, pair_of), {hn::LoadU(ids, at) + hn::Set(ids, input.first_candidate), hn::Zero(ids)}};
    }
  }

  template <class D, class PairOf>
  static HWY_INLINE LaneIds<D> listed_ids(D d, const PairOf& pair_of) {
    const hn::RebindToUnsigned<D> ids;
    hn::Vec<D> words[4];
    geometry::HWY_NAMESPACE::gather_rows(
        d, [&](std::size_t lane) { return reinterpret_cast<const float*>(&pair_of(lane)); }, words);
    return {hn::BitCast(ids, words[2]), hn::BitCast(ids, words[3])};
  }
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
