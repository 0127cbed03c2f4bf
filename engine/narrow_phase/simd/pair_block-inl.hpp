// Shared by all closed-form kernels: tests candidate pairs in vectors, one pair per lane. Included once for each
// Highway target.
//
// A kernel is a struct with the two kinds and `static LaneContacts<D> test(D, const Lanes<D>&)`, for D of float and of
// double.

#if defined(RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL
#undef RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL
#else
#define RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL
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
    if constexpr (std::is_same_v<Pair, KernelPair>) {
      return {gather<K>(d, input, at), ids_of(d, at)};
    } else {
      const hn::RebindToUnsigned<D> ids;
      return {gather<K>(d, input, at),
              {hn::Iota(ids, input.first_candidate + static_cast<std::uint32_t>(i)), hn::Zero(ids)}};
    }
  }
};

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
template <class K, class D, class Pair>
PairContact* run_full(D d, const InputPairs<Pair>& list, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const std::size_t size = list.pairs.size();
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
template <class K, class D, class Pair>
PairContact* run_timed(D d, const InputPairs<Pair>& list, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d), most = 64 / lanes;
  const std::size_t size = list.pairs.size();
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
template <class K, class D, class Pair>
PairContact* run_rest(D d, const InputPairs<Pair>& list, std::size_t count, PairContact* out, KindCounters& counters) {
  begin_gathering(list.input);
  const PairLanes<D> in = list.template gather_rest<K>(d, list.pairs.size() - count);
  end_gathering(list.input);
  counters.lanes += hn::MaxLanes(d);
  return test_one<K>(d, in, count, out);
}

/// Tests all pairs in float: full vectors first, then the narrowest vector that holds the rest.
template <class K, class Pair>
PairContact* run_in_float(const InputPairs<Pair>& list, PairContact* out, KindCounters& counters) {
  hn::CappedTag<float, 16> full;
  hn::CappedTag<float, 8> half;
  hn::CappedTag<float, 4> quarter;
  const std::size_t size = list.pairs.size(), rest = size % hn::MaxLanes(full);
  out = list.input.gather_timer == nullptr ? run_full<K>(full, list, out) : run_timed<K>(full, list, out);
  counters.lanes_filled += size;
  counters.lanes += size - rest;
  if (rest == 0) return out;
  if (rest > hn::MaxLanes(half)) return run_rest<K>(full, list, rest, out, counters);
  if (rest > hn::MaxLanes(quarter)) return run_rest<K>(half, list, rest, out, counters);
  return run_rest<K>(quarter, list, rest, out, counters);
}

/// Columns of pairs for the kernels in double. Such pairs are rare: they are gathered and written one by one.
template <std::size_t N>
struct Columns {
  alignas(64) double offset[3][N], first_orientation[4][N], second_orientation[4][N], first_size[3][N],
      second_size[3][N];

  void fill(const KernelInput& input, const KernelPair& pair, std::size_t lane) {
    const Body& first = input.bodies[pair.first];
    const Body& second = input.bodies[pair.second];
    const geometry::ShapeRow& first_row = input.shapes.row(first.shape);
    const geometry::ShapeRow& second_row = input.shapes.row(second.shape);
    offset[0][lane] = second.pose.position.x - first.pose.position.x;
    offset[1][lane] = second.pose.position.y - first.pose.position.y;
    offset[2][lane] = second.pose.position.z - first.pose.position.z;
    const Quat &p = first.pose.orientation, &q = second.pose.orientation;
    const float p_parts[4] = {p.x, p.y, p.z, p.w}, q_parts[4] = {q.x, q.y, q.z, q.w};
    for (std::size_t k = 0; k < 4; ++k) {
      first_orientation[k][lane] = static_cast<double>(p_parts[k]);
      second_orientation[k][lane] = static_cast<double>(q_parts[k]);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      first_size[k][lane] = static_cast<double>(first_row.size[k]);
      second_size[k][lane] = static_cast<double>(second_row.size[k]);
    }
  }

  template <class D>
  Lanes<D> lanes(D d) const {
    return {{hn::Load(d, offset[0]), hn::Load(d, offset[1]), hn::Load(d, offset[2])},
            {hn::Load(d, first_orientation[0]), hn::Load(d, first_orientation[1]), hn::Load(d, first_orientation[2]),
             hn::Load(d, first_orientation[3])},
            {hn::Load(d, second_orientation[0]), hn::Load(d, second_orientation[1]), hn::Load(d, second_orientation[2]),
             hn::Load(d, second_orientation[3])},
            {hn::Load(d, first_size[0]), hn::Load(d, first_size[1]), hn::Load(d, first_size[2])},
            {hn::Load(d, second_size[0]), hn::Load(d, second_size[1]), hn::Load(d, second_size[2])}};
  }
};

template <class K>
PairContact* run_in_double(const KernelInput& input, PairContact* out, KindCounters& counters) {
  counters.lanes_filled += input.pairs.size();
  using D = hn::CappedTag<double, 8>;
  const D d;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  Columns<lanes> columns;
  alignas(64) double found[7][lanes];
  for (std::size_t begin = 0; begin < input.pairs.size(); begin += lanes) {
    const std::size_t count = std::min(input.pairs.size() - begin, lanes);
    begin_gathering(input);
    for (std::size_t i = 0; i < lanes; ++i) columns.fill(input, input.pairs[begin + std::min(i, count - 1)], i);
    end_gathering(input);
    const LaneContacts<D> f = K::test(d, columns.lanes(d));
    const hn::Vec<D> rows[7] = {f.depth, f.normal.x, f.normal.y, f.normal.z, f.point.x, f.point.y, f.point.z};
    for (std::size_t r = 0; r < 7; ++r) hn::Store(rows[r], d, found[r]);
    std::uint8_t hits[8] = {};
    hn::StoreMaskBits(d, f.hit, hits);
    for (std::size_t i = 0; i < count; ++i) {
      if ((hits[0] >> i & 1) == 0) continue;
      const KernelPair& pair = input.pairs[begin + i];
      double v[7];
      for (std::size_t r = 0; r < 7; ++r) v[r] = found[r][i];
      if (pair.flipped != 0) {
        for (std::size_t r = 0; r < 3; ++r) {
          v[1 + r] = -v[1 + r];
          v[4 + r] -= columns.offset[r][i];
        }
      }
      float w[7];
      for (std::size_t r = 0; r < 7; ++r) w[r] = static_cast<float>(v[r]) + 0.0f;
      *out++ = {pair.pair, w[0] > 0 ? w[0] : 0.0f, {w[1], w[2], w[3]}, {w[4], w[5], w[6]}};
    }
    counters.lanes += lanes;
  }
  return out;
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
