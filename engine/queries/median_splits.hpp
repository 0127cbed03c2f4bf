#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "queries/frame_object.hpp"
#include "queries/tree_box.hpp"
#include "ringfence/seen_state.hpp"

namespace ringfence::queries {

/// The median of three places along each axis: one that is far from the others does not count.
inline Vec3d median(const Vec3d& p, const Vec3d& q, const Vec3d& r) noexcept {
  const auto middle = [](double a, double b, double c) {
    return std::max(std::min(a, b), std::min(std::max(a, b), c));
  };
  return {middle(p.x, q.x, r.x), middle(p.y, q.y, r.y), middle(p.z, q.z, r.z)};
}

/// Finds an order of rows in which neighbours in space are near each other, for a BoxTree: the objects are divided at
/// the median along the longest side of the box around their positions, and each half again, down to the leaves of the
/// tree, so that each node of the tree has the objects of a box. (A k-d tree; Bentley 1975.) Objects whose places along
/// an axis differ by less than 1 of 2^18 count as equal.
///
/// Threads: belongs to one. Memory: grows to the largest call. May throw std::bad_alloc.
class MedianSplits {
 public:
  /// Sorts keys of objects.
  void sort(const FrameRows& objects, std::vector<std::uint32_t>& keys);
  /// Sorts numbers of rows by the centres of bounds, in a space whose steps have the same size along each axis.
  void sort(std::span<const RowBounds> bounds, std::vector<std::uint32_t>& rows);
  /// Sorts numbers of states by their positions. Memory: for at most 16,384 of them.
  void sort(std::span<const SeenState> states, std::span<std::uint32_t> numbers);

 private:
  /// A place from that of the first object and the bits of the key: four floats, which are one vector.
  struct alignas(16) Point {
    float at[4];
  };
  struct Range;

  template <class PlaceOf>
  void sort_by(const PlaceOf& place_of, std::span<std::uint32_t> rows);
  static Range range_of(std::span<const Point> points);
  void split(std::span<Point> points, Point* room, std::size_t each, std::uint32_t* rows);
  static void divide_few(std::span<const Point> points, std::size_t count, std::size_t axis, Point* out);
  void divide_many(std::span<const Point> points, std::size_t count, std::size_t axis, const Range& range, Point* out);

  std::vector<Point> points_, moved_, middle_;
};

/// One for all that this thread sorts.
MedianSplits& thread_splits();

}  // namespace ringfence::queries
