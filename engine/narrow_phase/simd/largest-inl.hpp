// The largest of the values in the lanes of a vector. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_LARGEST_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_LARGEST_INL
#undef RINGFENCE_NARROW_PHASE_LARGEST_INL
#else
#define RINGFENCE_NARROW_PHASE_LARGEST_INL
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Values, and the number of each.
template <class D>
struct Numbered {
  hn::Vec<D> value, number;
};

template <class D>
inline constexpr bool has_one_lane = hn::MaxLanes(D()) == 1;

// The upper half of a vector of at least two lanes.
template <class D, class Half = hn::Half<D>>
HWY_INLINE hn::Vec<Half> upper_half(D, hn::Vec<D> v) {
#if HWY_TARGET == HWY_SCALAR
  return v;  // not called
#else
  return hn::UpperHalf(Half(), v);
#endif
}

// In lane 0: the largest value, and the lowest number that has it. The lanes are halved until one is left: to compare
// them one after another takes several times as long. Not by the reductions of <immintrin.h>: clang's take infinity for
// the largest finite number.
template <class D>
HWY_INLINE auto largest_of_lanes(D d, const Numbered<D>& of) {
  if constexpr (has_one_lane<D>) {
    return of;
  } else {
    using Half = hn::Half<D>;
    const Half half;
    const auto value = hn::LowerHalf(half, of.value), other = upper_half(d, of.value);
    const auto number = hn::LowerHalf(half, of.number), other_number = upper_half(d, of.number);
    const auto is_better = hn::Or(hn::Gt(other, value), hn::And(hn::Eq(other, value), hn::Lt(other_number, number)));
    return largest_of_lanes(
        half, Numbered<Half>{hn::IfThenElse(is_better, other, value), hn::IfThenElse(is_better, other_number, number)});
  }
}

// The largest value. NaN and the sign of a zero must not matter.
template <class D>
HWY_INLINE hn::TFromD<D> most_of_lanes(D d, hn::Vec<D> value) {
  if constexpr (has_one_lane<D>) {
    return hn::GetLane(value);
  } else {
    const hn::Half<D> half;
    return most_of_lanes(half, hn::Max(hn::LowerHalf(half, value), upper_half(d, value)));
  }
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
