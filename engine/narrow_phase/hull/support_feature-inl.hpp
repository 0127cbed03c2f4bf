// The feature of a polytope that is farthest along a direction: a vertex, or the vertices of an edge or a face within
// rounding. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_SUPPORT_FEATURE_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_SUPPORT_FEATURE_INL
#undef RINGFENCE_NARROW_PHASE_SUPPORT_FEATURE_INL
#else
#define RINGFENCE_NARROW_PHASE_SUPPORT_FEATURE_INL
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include "narrow_phase/hull/feature_points.hpp"
#include "narrow_phase/hull/polytope_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The overlap of two shapes, in the axes of the first and relative to its origin.
template <class T>
struct Overlap {
  T depth;
  Point<T> normal;  ///< unit, from the first to the second
  Point<T> point;
};

/// Limits below which rounding decides, as sines. Arcs of normals that miss each other by less than `miss` count as
/// crossing. Arcs that meet by less than `sure`, and edges nearer to parallel than `sure_sine_squared`, are evaluated
/// by their exact overlap. Edges nearer to parallel than `parallel_sine_squared` have no common perpendicular.
template <class T>
struct Rounding {
  static constexpr T miss = sizeof(T) == 4 ? T(1e-6) : T(3e-7);
  static constexpr T sure = T(1e-5);
  static constexpr T sure_sine_squared = T(1e-4);
  static constexpr T parallel_sine_squared = sizeof(T) == 4 ? T(1e-12) : T(1e-20);
  /// The error of an overlap along a direction, as part of the two sizes. Limits for candidates are increased by this.
  static constexpr T overlap = sizeof(T) == 4 ? T(1e-6) : T(2e-8);
  /// The difference in height of vertices of one feature, as part of the two sizes. Face normals are in float.
  static constexpr T height = sizeof(T) == 4 ? T(3e-6) : T(1.5e-7);
};

/// Collects the indices below `size` for which `test` is true as a set of bits and returns their number. `test(i)`
/// returns the mask of the vector that starts at i.
template <class D, class Test>
HWY_INLINE std::size_t collect(D d, std::size_t size, std::uint64_t* set, const Test& test) {
  std::size_t count = 0;
  for (std::size_t begin = 0; begin < size; begin += 64) {
    std::uint64_t word = 0;
    const std::size_t end = std::min(size, begin + 64);
    for (std::size_t i = begin; i < end; i += hn::Lanes(d)) {
      word |= std::uint64_t{bits_of(d, test(i))} << (i - begin);
    }
    word &= ~std::uint64_t{0} >> (64 - (end - begin));
    set[begin / 64] = word;
    count += static_cast<std::size_t>(std::popcount(word));
  }
  return count;
}

template <class Visit>
HWY_INLINE void for_each_in(const std::uint64_t* set, std::size_t size, const Visit& visit) {
  for (std::size_t w = 0; w * 64 < size; ++w) {
    for (std::uint64_t bits = set[w]; bits != 0; bits &= bits - 1) {
      visit(w * 64 + static_cast<std::size_t>(std::countr_zero(bits)));
    }
  }
}

/// The vertices that are farthest along a direction, within rounding.
template <class T>
struct Feature {
  std::uint64_t vertices[geometry::max_hull_vertices / 64];
  std::size_t count;
  T height;

  HWY_INLINE std::size_t first() const {
    std::size_t w = 0;
    while (vertices[w] == 0) ++w;
    return w * 64 + static_cast<std::size_t>(std::countr_zero(vertices[w]));
  }
  /// `size`: the number of vertices of the polytope.
  HWY_INLINE std::size_t last(std::size_t size) const {
    std::size_t w = (size - 1) / 64;
    while (vertices[w] == 0) --w;
    return w * 64 + 63 - static_cast<std::size_t>(std::countl_zero(vertices[w]));
  }
};

/// Finds the feature of a polytope along a direction. Vertices belong to it if they are at most `slack` less far.
template <class T>
HWY_INLINE void find_feature(const Polytope& p, Point<T> direction, T slack, Feature<T>& out) {
  const Columns16<T> d;
  out.height = support<T>(p, direction);
  const auto direction_lanes = spread_out(d, direction);
  const auto least = hn::Set(d, out.height - slack);
  out.count = collect(d, p.vertices, out.vertices, [&](std::size_t i) HWY_ATTR {
    return hn::Ge(dot_of(d, read(d, p.vertex[0] + i, p.vertex[1] + i, p.vertex[2] + i), direction_lanes), least);
  });
}

/// The distance by which a point lies outside of a polytope: the greatest distance from a face's plane, negative
/// inside.
template <class T>
HWY_INLINE T distance_outside_polytope(const Polytope& p, Point<T> point) {
  const Columns16<T> d;
  const auto q = spread_out(d, point);
  const auto height = [&](std::size_t i) HWY_ATTR {
    return dot_of(d, read(d, p.normal[0] + i, p.normal[1] + i, p.normal[2] + i), q) - read(d, p.offset + i);
  };
  auto most = height(0);
  for (std::size_t i = hn::Lanes(d); i < p.faces; i += hn::Lanes(d)) most = hn::Max(most, height(i));
  return hn::GetLane(hn::MaxOfLanes(d, most));
}

/// Whether a point lies more than `most` outside of a polytope.
template <class T>
HWY_INLINE bool outside(const Polytope& p, Point<T> point, T most_outside) {
  const Columns16<T> d;
  const auto q = spread_out(d, point);
  const auto most = hn::Set(d, most_outside);
  for (std::size_t i = 0; i < p.faces; i += hn::Lanes(d)) {
    const auto normal = read(d, p.normal[0] + i, p.normal[1] + i, p.normal[2] + i);
    if (!hn::AllTrue(d, hn::Le(dot_of(d, normal, q) - read(d, p.offset + i), most))) return true;
  }
  return false;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
