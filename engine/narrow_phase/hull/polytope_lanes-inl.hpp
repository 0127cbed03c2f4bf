// Columns of floats read in lanes of float or double, and the reductions of the convex kernels. Included once for each
// Highway target.
//
// A reduction returns the greatest or least value and, on demand, the lowest index that has it. The result is the same
// for every vector width.

#if defined(RINGFENCE_NARROW_PHASE_POLYTOPE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_POLYTOPE_LANES_INL
#undef RINGFENCE_NARROW_PHASE_POLYTOPE_LANES_INL
#else
#define RINGFENCE_NARROW_PHASE_POLYTOPE_LANES_INL
#endif

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include <hwy/highway.h>

#include "geometry/max_lanes-inl.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/hull/polytope.hpp"
#include "narrow_phase/kernel.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Columns are padded to 16 floats, so no vector reads past them.
template <class T>
using Columns16 = hn::CappedTag<T, geometry::hull_lanes>;
template <class T>
using Point = std::conditional_t<sizeof(T) == 4, Vec3f, Vec3d>;
template <class T>
using RotationMatrix = geometry::RotationOf<T>;

/// Counts the work of a test for the counters.
struct WorkCounts {
  std::size_t lanes = 0, filled = 0, directions = 0, ended_early = 0;

  /// Counts a pass over `count` items, one vector at a time.
  template <class T>
  HWY_INLINE void pass(std::size_t count) {
    constexpr std::size_t width = hn::MaxLanes(Columns16<T>());
    lanes += (count + width - 1) / width * width;
    filled += count;
  }
  void add_to(KindCounters& counters) const {
    counters.lanes += lanes;
    counters.lanes_filled += filled;
    counters.iterations += directions;
    counters.ended_early += ended_early;
  }
};

template <class T>
HWY_INLINE Point<T> point_of(Vec3f p) {
  if constexpr (sizeof(T) == 4) {
    return p;
  } else {
    return to_double(p);
  }
}

template <class T>
HWY_INLINE RotationMatrix<T> rotation_matrix_of(Quat q) {
  if constexpr (sizeof(T) == 4) {
    return geometry::rotation(q);
  } else {
    return geometry::rotation_exact(q);
  }
}

template <class T>
HWY_INLINE Point<T> difference_of(Vec3d to, Vec3d from) {
  if constexpr (sizeof(T) == 4) {
    return to_float(to - from);
  } else {
    return to - from;
  }
}

template <class D>
HWY_INLINE hn::Vec<D> read(D d, const float* column) {
  if constexpr (sizeof(hn::TFromD<D>) == 4) {
    return hn::Load(d, column);
  } else {
    return hn::PromoteTo(d, hn::Load(hn::Rebind<float, D>(), column));
  }
}

/// Three vectors: one point or direction per lane.
template <class D>
struct Points {
  hn::Vec<D> x, y, z;
};

template <class D>
HWY_INLINE Points<D> read(D d, const float* x, const float* y, const float* z) {
  return {read(d, x), read(d, y), read(d, z)};
}

template <class D, class P>
HWY_INLINE Points<D> spread_out(D d, const P& p) {
  return {hn::Set(d, p.x), hn::Set(d, p.y), hn::Set(d, p.z)};
}

template <class D>
HWY_INLINE hn::Vec<D> dot_of(D, const Points<D>& p, const Points<D>& q) {
  return p.x * q.x + p.y * q.y + p.z * q.z;
}

template <class D>
HWY_INLINE Points<D> minus(D, const Points<D>& p, const Points<D>& q) {
  return {p.x - q.x, p.y - q.y, p.z - q.z};
}

template <class D>
HWY_INLINE Points<D> rotated(D d, const RotationMatrix<hn::TFromD<D>>& r, const Points<D>& p) {
  const auto row = [&](int i) HWY_ATTR {
    return hn::Set(d, r.m[i][0]) * p.x + hn::Set(d, r.m[i][1]) * p.y + hn::Set(d, r.m[i][2]) * p.z;
  };
  return {row(0), row(1), row(2)};
}

template <class D>
HWY_INLINE Points<D> rotated_back(D d, const RotationMatrix<hn::TFromD<D>>& r, const Points<D>& p) {
  const auto row = [&](int i) HWY_ATTR {
    return hn::Set(d, r.m[0][i]) * p.x + hn::Set(d, r.m[1][i]) * p.y + hn::Set(d, r.m[2][i]) * p.z;
  };
  return {row(0), row(1), row(2)};
}

/// The lanes of a mask as bits, lane 0 lowest.
template <class D>
HWY_INLINE std::uint32_t bits_of(D d, hn::Mask<D> mask) {
  std::uint8_t bytes[8];
  hn::StoreMaskBits(d, mask, bytes);
  // Reads exactly what was written: a wider load could not be forwarded from the store buffer.
  if constexpr (hn::MaxLanes(D()) <= 8) return bytes[0];
  std::conditional_t<(hn::MaxLanes(D()) <= 16), std::uint16_t, std::uint32_t> bits;
  std::memcpy(&bits, bytes, sizeof(bits));
  return bits;
}

/// A mask of the first `count` of 32 bits.
HWY_INLINE std::uint32_t first_bits(std::size_t count) { return count >= 32 ? ~0u : (1u << count) - 1; }

template <class T>
HWY_INLINE Point<T> vertex_of(const Polytope& p, std::size_t i) {
  return point_of<T>({p.vertex[0][i], p.vertex[1][i], p.vertex[2][i]});
}

template <class T>
HWY_INLINE Point<T> normal_of(const Polytope& p, std::size_t face) {
  return point_of<T>({p.normal[0][face], p.normal[1][face], p.normal[2][face]});
}

/// The unit direction from start to end of an edge. In double it is recomputed, since the stored one is rounded to
/// float.
template <class T>
HWY_INLINE Point<T> along_edge(const Polytope& p, std::size_t i) {
  if constexpr (sizeof(T) == 4) {
    return p.edge[i].along;
  } else {
    const Point<T> edge = vertex_of<T>(p, p.edge[i].to) - vertex_of<T>(p, p.edge[i].from);
    return edge * (T(1) / std::sqrt(dot(edge, edge)));
  }
}

template <class T>
HWY_INLINE T edge_length(const Polytope& p, std::size_t i) {
  if constexpr (sizeof(T) == 4) {
    return p.of(geometry::EdgeColumn::length)[i];
  } else {
    return length(vertex_of<T>(p, p.edge[i].to) - vertex_of<T>(p, p.edge[i].from));
  }
}

/// The support of a polytope: the maximum of direction · vertex.
template <class T>
HWY_INLINE T support(const Polytope& p, Point<T> direction) {
  const Columns16<T> d;
  const auto direction_lanes = spread_out(d, direction);
  auto most = dot_of(d, read(d, p.vertex[0], p.vertex[1], p.vertex[2]), direction_lanes);
  for (std::size_t i = hn::Lanes(d); i < p.vertices; i += hn::Lanes(d)) {
    most = hn::Max(most, dot_of(d, read(d, p.vertex[0] + i, p.vertex[1] + i, p.vertex[2] + i), direction_lanes));
  }
  return hn::GetLane(hn::MaxOfLanes(d, most));
}

/// The lowest of the indices at[lane] + lane, over the lanes whose bits are set: at least one.
template <class Int>
HWY_INLINE std::size_t lowest_index(std::uint32_t lane_bits, const Int* at) {
  const auto of_lane = [&](std::uint32_t bits) HWY_ATTR {
    const auto lane = static_cast<std::size_t>(__builtin_ctz(bits));
    return static_cast<std::size_t>(at[lane]) + lane;
  };
  std::size_t index = of_lane(lane_bits);
  for (lane_bits &= lane_bits - 1; HWY_UNLIKELY(lane_bits != 0); lane_bits &= lane_bits - 1) {
    index = std::min(index, of_lane(lane_bits));
  }
  return index;
}

/// Finds the index of the least value; the lowest index if there are several. Without a branch on its position, which
/// would be unpredictable.
template <class T>
class Least {
 public:
  HWY_INLINE explicit Least(hn::Vec<Columns16<T>> first) : least_(first), at_(hn::Zero(ints)) {}

  /// Adds the values of a vector that starts at index `i`. Call in ascending order of i.
  HWY_INLINE void add(hn::Vec<Columns16<T>> values, std::size_t i) {
    const auto less = hn::RebindMask(ints, hn::Lt(values, least_));
    at_ = hn::IfThenElse(less, hn::Set(ints, static_cast<Int>(i)), at_);
    least_ = hn::Min(values, least_);
  }

  HWY_INLINE T value() const { return hn::GetLane(hn::MinOfLanes(d, least_)); }

  HWY_INLINE std::size_t index() const {
    alignas(64) Int at[hn::MaxLanes(d)];
    hn::Store(at_, ints, at);
    return lowest_index(bits_of(d, hn::Eq(least_, hn::MinOfLanes(d, least_))), at);
  }

 private:
  static constexpr Columns16<T> d{};
  static constexpr hn::RebindToSigned<Columns16<T>> ints{};
  using Int = hwy::MakeSigned<T>;
  hn::Vec<Columns16<T>> least_;
  hn::Vec<hn::RebindToSigned<Columns16<T>>>
      at_;  // for each lane: the start index of the vector that holds its least value
};

/// The index of the least of `values`; the lowest index if there are several. The padding to 16 values must not be
/// less.
template <class T>
HWY_INLINE std::size_t least_of(const T* values, std::size_t count) {
  const Columns16<T> d;
  Least<T> least(hn::Load(d, values));
  for (std::size_t i = hn::Lanes(d); i < count; i += hn::Lanes(d)) least.add(hn::Load(d, values + i), i);
  return least.index();
}

/// The vertex farthest along a direction, among `count` vertices in three padded columns. The value is minus its
/// distance along the direction.
template <class T>
HWY_INLINE Least<T> farthest_of(const float* const column[3], std::size_t count, Point<T> direction) {
  const Columns16<T> d;
  const auto direction_lanes = spread_out(d, -direction);
  const auto nearness = [&](std::size_t i) HWY_ATTR {
    return dot_of(d, read(d, column[0] + i, column[1] + i, column[2] + i), direction_lanes);
  };
  Least<T> least(nearness(0));
  for (std::size_t i = hn::Lanes(d); i < count; i += hn::Lanes(d)) least.add(nearness(i), i);
  return least;
}

/// The lowest index among the vertices farthest along a direction.
template <class T>
HWY_INLINE std::size_t farthest_vertex(const Polytope& p, Point<T> direction) {
  return farthest_of<T>(p.vertex, p.vertices, direction).index();
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
