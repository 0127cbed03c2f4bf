// Shared by all closed-form kernels: tests candidate pairs in vectors, one pair per lane. Included once for each Highway
// target.
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

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/simd/lane_contacts-inl.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"
#include "narrow_phase/simd/pair_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Tests one vector of pairs and writes the contacts of the first `count`. Not inlined, so that there is one copy of
/// the kernel for all places that call it.
template <class K, class D>
HWY_NOINLINE PairContact* test_one(D d, const Lanes<D>& in, const KernelPair* pairs, std::size_t count,
                                   PairContact* out) {
  return write<K>(d, pairs, count, K::test(d, in), in.offset, out);
}

/// Tests two vectors of pairs. Most instructions of a test depend on the one before, and a processor does not look
/// ahead as far as to the next vector, so the compiler mixes the instructions of both: CMakeLists.txt has the option.
template <class K, class D>
HWY_NOINLINE PairContact* test_two(D d, const Lanes<D>* in, const KernelPair* pairs, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const LaneContacts<D> p = K::test(d, in[0]), q = K::test(d, in[1]);
  out = write<K>(d, pairs, lanes, p, in[0].offset, out);
  return write<K>(d, pairs + lanes, lanes, q, in[1].offset, out);
}

/// Tests full vectors of pairs.
template <class K, class D>
PairContact* run_full(D d, const KernelInput& input, const KernelPair* pairs, std::size_t vectors, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  Lanes<D> gathered[2];
  for (; vectors >= 2; vectors -= 2, pairs += 2 * lanes) {
    gathered[0] = gather<K>(d, input, pairs);
    gathered[1] = gather<K>(d, input, pairs + lanes);
    out = test_two<K>(d, gathered, pairs, out);
  }
  return vectors == 0 ? out : test_one<K>(d, gather<K>(d, input, pairs), pairs, lanes, out);
}

/// The same for pairs that are timed. They are gathered in larger groups, because reading the clock takes as long as
/// gathering a vector.
template <class K, class D>
PairContact* run_timed(D d, const KernelInput& input, const KernelPair* pairs, std::size_t vectors, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d), most = 64 / lanes;
  Lanes<D> gathered[most];
  while (vectors > 0) {
    const std::size_t count = std::min(vectors, most);
    input.gather_timer->begin();
    for (std::size_t v = 0; v < count; ++v) gathered[v] = gather<K>(d, input, pairs + v * lanes);
    input.gather_timer->end();
    for (std::size_t v = 0; v + 1 < count; v += 2) out = test_two<K>(d, gathered + v, pairs + v * lanes, out);
    if (count % 2 != 0) out = test_one<K>(d, gathered[count - 1], pairs + (count - 1) * lanes, lanes, out);
    vectors -= count;
    pairs += count * lanes;
  }
  return out;
}

/// Tests fewer pairs than a vector holds. The lanes after the last pair repeat it and are not written.
template <class K, class D>
PairContact* run_rest(D d, const KernelInput& input, const KernelPair* pairs, std::size_t count, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  KernelPair padded[lanes];
  std::fill(std::copy_n(pairs, count, padded), padded + lanes, pairs[count - 1]);
  begin_gathering(input);
  const Lanes<D> in = gather<K>(d, input, padded);
  end_gathering(input);
  return test_one<K>(d, in, padded, count, out);
}

/// Tests all pairs in float: full vectors first, then the narrowest vector that holds the rest.
template <class K>
PairContact* run_in_float(const KernelInput& input, PairContact* out, KindCounters& counters) {
  hn::CappedTag<float, 16> full;
  hn::CappedTag<float, 8> half;
  hn::CappedTag<float, 4> quarter;
  constexpr std::size_t lanes = hn::MaxLanes(full);
  const std::size_t size = input.pairs.size();
  const KernelPair* pairs = input.pairs.data();
  const std::size_t begin = size / lanes * lanes;
  out = input.gather_timer == nullptr ? run_full<K>(full, input, pairs, size / lanes, out)
                                      : run_timed<K>(full, input, pairs, size / lanes, out);
  counters.lanes += begin;
  const std::size_t rest = size - begin;
  if (rest == 0) return out;
  if (rest > hn::MaxLanes(half)) {
    counters.lanes += lanes;
    return run_rest<K>(full, input, pairs + begin, rest, out);
  }
  if (rest > hn::MaxLanes(quarter)) {
    counters.lanes += hn::MaxLanes(half);
    return run_rest<K>(half, input, pairs + begin, rest, out);
  }
  counters.lanes += hn::MaxLanes(quarter);
  return run_rest<K>(quarter, input, pairs + begin, rest, out);
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
  counters.lanes_filled += input.pairs.size();
  return input.in_double ? run_in_double<K>(input, out, counters) : run_in_float<K>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
