#include "queries/median_splits.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#include <Eigen/Core>

#include "base/prefetch.hpp"
#include "geometry/vector.hpp"
#include "queries/box_tree.hpp"

namespace ringfence::queries {
namespace {

constexpr std::size_t few = 32;
constexpr std::size_t most_slices = 256;

}  // namespace

/// The box around some points. The fourth numbers mean nothing.
struct MedianSplits::Range {
  Eigen::Array4f lower, upper;

  std::size_t longest() const {
    const Eigen::Array4f side = upper - lower;
    std::size_t axis = 0;
    for (std::size_t a = 1; a < 3; ++a) {
      if (side[static_cast<int>(a)] > side[static_cast<int>(axis)]) axis = a;
    }
    return axis;
  }
};

MedianSplits::Range MedianSplits::range_of(std::span<const Point> points) {
  using Place = Eigen::Map<const Eigen::Array4f, Eigen::Aligned16>;
  Eigen::Array4f lower = Place(points[0].at), upper = lower;
  for (const Point& point : points) {
    lower = lower.min(Place(point.at));
    upper = upper.max(Place(point.at));
  }
  return {lower, upper};
}

void MedianSplits::sort(const FrameRows& objects, std::vector<std::uint32_t>& keys) {
  constexpr std::size_t ahead = 16;
  sort_by(
      [&](std::size_t i) {
        base::prefetch_for_read(&objects.rows[objects.row_of[keys[std::min(i + ahead, keys.size() - 1)]]]);
        return objects.rows[objects.row_of[keys[i]]].pose.position;
      },
      keys);
}

void MedianSplits::sort(std::span<const RowBounds> bounds, std::vector<std::uint32_t>& rows) {
  sort_by(
      [&](std::size_t i) {
        const geometry::Bounds& box = bounds[rows[i]].bounds;
        const auto twice_centre = [&](std::size_t a) {
          return static_cast<double>(std::uint64_t{box.lower[a]} + box.upper[a]);
        };
        return Vec3d{twice_centre(0), twice_centre(1), twice_centre(2)};
      },
      rows);
}

void MedianSplits::sort(std::span<const SeenState> states, std::span<std::uint32_t> numbers) {
  constexpr std::size_t most_points = 4096, many_leaves = 1024;
  const auto place_of = [&](std::size_t i) -> const Vec3d& { return states[numbers[i]].pose.position; };
  if (numbers.size() <= most_points) return sort_by(place_of, numbers);
  // To divide the numbers in place takes longer, but no memory.
  Vec3d lower = place_of(0), upper = lower;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const Vec3d& p = place_of(i);
    lower = {std::min(lower.x, p.x), std::min(lower.y, p.y), std::min(lower.z, p.z)};
    upper = {std::max(upper.x, p.x), std::max(upper.y, p.y), std::max(upper.z, p.z)};
  }
  const Vec3d side = upper - lower;
  const auto along = side.x >= std::max(side.y, side.z) ? &Vec3d::x : side.y >= side.z ? &Vec3d::y : &Vec3d::z;
  const std::size_t half = (numbers.size() / 2 + many_leaves - 1) / many_leaves * many_leaves;
  std::nth_element(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(half), numbers.end(),
                   [&](std::uint32_t p, std::uint32_t q) {
                     return states[p].pose.position.*along < states[q].pose.position.*along;
                   });
  sort(states, numbers.first(half));
  sort(states, numbers.subspan(half));
}

/// `place_of(i)`: the place of `rows[i]`.
template <class PlaceOf>
void MedianSplits::sort_by(const PlaceOf& place_of, std::span<std::uint32_t> rows) {
  if (rows.size() <= tree_width) return;
  points_.resize(rows.size());
  moved_.resize(rows.size());
  middle_.resize(rows.size() + 1);
  // Not that of one object, which may be far from all others: places are precise near the origin.
  const std::size_t quarter = rows.size() / 4;
  const Vec3d origin = median(place_of(quarter), place_of(2 * quarter), place_of(3 * quarter));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Vec3d at = place_of(i) - origin;
    points_[i] = {
        {static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z), std::bit_cast<float>(rows[i])}};
  }
  std::size_t each = tree_width;
  while (each * tree_width < rows.size()) each *= tree_width;
  split(points_, moved_.data(), each, rows.data());
}

/// Writes the rows of points so that each `each` of them, and those of each smaller node of the tree, are neighbours.
/// `room`: for as many points; both are overwritten.
void MedianSplits::split(std::span<Point> points, Point* room, std::size_t each, std::uint32_t* rows) {
  while (points.size() <= each) {
    if (each == tree_width) {
      for (std::size_t i = 0; i < points.size(); ++i) rows[i] = std::bit_cast<std::uint32_t>(points[i].at[3]);
      return;
    }
    each /= tree_width;
  }
  const Range range = range_of(points);
  const std::size_t nodes = (points.size() + each - 1) / each, half = (nodes + 1) / 2 * each;
  if (points.size() <= few) {
    divide_few(points, half, range.longest(), room);
  } else {
    divide_many(points, half, range.longest(), range, room);
  }
  split({room, half}, points.data(), each, rows);
  split({room + half, points.size() - half}, points.data() + half, each, rows + half);
}

/// Writes points to `out`, the `count` first that are lowest along an axis; at most `few`.
///
/// Each is compared with each, which takes few instructions and no branch that depends on a point.
void MedianSplits::divide_few(std::span<const Point> points, std::size_t count, std::size_t axis, Point* out) {
  // Integers in the order of the places; their last bits are the points' numbers, so that no two are equal.
  std::array<std::int32_t, few> keys;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto bits = std::bit_cast<std::int32_t>(points[i].at[axis]);
    const std::int32_t ordered = bits < 0 ? bits ^ std::numeric_limits<std::int32_t>::max() : bits;
    keys[i] = (ordered & -static_cast<std::int32_t>(few)) | static_cast<std::int32_t>(i);
  }
  for (std::size_t i = points.size(); i < few; ++i) keys[i] = std::numeric_limits<std::int32_t>::max();
  std::size_t low = 0, high = points.size() - 1;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::int32_t mine = keys[i];
    std::int32_t before = 0;
    for (std::size_t j = 0; j < few; ++j) before += keys[j] < mine ? 1 : 0;
    // One of the two is overwritten later, or is this point again.
    out[low] = out[high] = points[i];
    const std::size_t is_low = before < static_cast<std::int32_t>(count) ? 1 : 0;
    low += is_low;
    high -= 1 - is_low;
  }
}

/// The same for many points.
///
/// They are divided at the slice of their range that contains the last of the `count`, without a branch that depends on
/// a point; only those in that slice are compared with each other.
void MedianSplits::divide_many(std::span<const Point> points, std::size_t count, std::size_t axis, const Range& range,
                               Point* out) {
  const std::size_t slices = std::min(most_slices, points.size());
  const float lower = range.lower[static_cast<int>(axis)];
  const float ratio = static_cast<float>(slices - 1) / (range.upper[static_cast<int>(axis)] - lower);
  const float scale = ratio < std::numeric_limits<float>::max() ? ratio : 0;  // 0: they are all at about one place
  const auto place_of = [&](const Point& point) { return (point.at[axis] - lower) * scale; };

  // Neighbours in the list are often in the same slice. With two lists of sizes, the one need not wait for the other.
  std::array<std::array<std::uint32_t, most_slices>, 2> sizes{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto slice = static_cast<std::int32_t>(place_of(points[i]));
    ++sizes[i % 2][static_cast<std::size_t>(std::min(slice, static_cast<std::int32_t>(slices - 1)))];
  }
  std::size_t before = 0, slice = 0;
  for (; slice + 1 < slices; ++slice) {
    const std::size_t size = sizes[0][slice] + sizes[1][slice];
    if (before + size > count) break;
    before += size;
  }

  const float first = static_cast<float>(slice);
  const float end = slice + 1 < slices ? first + 1 : std::numeric_limits<float>::infinity();
  std::size_t low = 0, high = points.size() - 1, between = 0;
  for (const Point& point : points) {
    // Two of the three are overwritten later, or are this point again.
    out[low] = out[high] = middle_[between] = point;
    const float place = place_of(point);
    const std::size_t is_low = place < first ? 1 : 0, is_high = place >= end ? 1 : 0;
    low += is_low;
    high -= is_high;
    between += 1 - is_low - is_high;
  }
  const std::span<Point> middle(middle_.data(), between);
  if (before < count && count < before + between) {
    std::nth_element(middle.begin(), middle.begin() + static_cast<std::ptrdiff_t>(count - before), middle.end(),
                     [axis](const Point& p, const Point& q) { return p.at[axis] < q.at[axis]; });
  }
  std::copy(middle.begin(), middle.end(), out + before);
}

MedianSplits& thread_splits() {
  thread_local MedianSplits mine;
  return mine;
}

}  // namespace ringfence::queries
