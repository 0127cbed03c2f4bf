// Tests pairs in double, for the closed-form kernels. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_PAIR_DOUBLE_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PAIR_DOUBLE_INL
#undef RINGFENCE_NARROW_PHASE_PAIR_DOUBLE_INL
#else
#define RINGFENCE_NARROW_PHASE_PAIR_DOUBLE_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"
#include "narrow_phase/simd/pair_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

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

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
