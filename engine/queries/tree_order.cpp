#include "queries/tree_order.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "geometry/vector.hpp"
#include "queries/box_tree.hpp"

namespace ringfence::queries {

void MedianSplits::sort(std::span<const FrameObject> objects, std::vector<std::uint32_t>& rows) {
  if (rows.size() <= tree_width) return;
  const Vec3d origin = objects[rows[0]].pose.position;
  points_.resize(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Vec3d at = objects[rows[i]].pose.position - origin;
    points_[i] = {{static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z)}, rows[i]};
  }
  std::size_t each = tree_width;
  while (each * tree_width < rows.size()) each *= tree_width;
  split(points_, each);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = points_[i].row;
}

/// Orders points so that each `each` of them, and the points of each smaller node of the tree, are neighbours.
void MedianSplits::split(std::span<Point> points, std::size_t each) {
  while (points.size() <= each) {
    if (each == tree_width) return;
    each /= tree_width;
  }
  float lower[3], upper[3];
  for (std::size_t a = 0; a < 3; ++a) lower[a] = upper[a] = points[0].at[a];
  for (const Point& point : points) {
    for (std::size_t a = 0; a < 3; ++a) {
      lower[a] = std::min(lower[a], point.at[a]);
      upper[a] = std::max(upper[a], point.at[a]);
    }
  }
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a) {
    if (upper[a] - lower[a] > upper[axis] - lower[axis]) axis = a;
  }
  const std::size_t nodes = (points.size() + each - 1) / each, half = (nodes + 1) / 2 * each;
  put_first(points, half, axis, lower[axis], upper[axis]);
  split(points.first(half), each);
  split(points.subspan(half), each);
}

/// Puts the `count` points that are lowest along an axis first. `lower`, `upper`: the range of all along that axis.
///
/// Many points are divided at the slice of the range that contains the last of the `count`, without a branch that
/// depends on a point; only those in that slice are compared with each other.
void MedianSplits::put_first(std::span<Point> points, std::size_t count, std::size_t axis, float lower, float upper) {
  constexpr std::size_t few = 128, slices = 256;
  const auto is_lower = [axis](const Point& p, const Point& q) { return p.at[axis] < q.at[axis]; };
  const auto select = [&](std::span<Point> among, std::size_t first) {
    if (first < among.size()) {
      std::nth_element(among.begin(), among.begin() + static_cast<std::ptrdiff_t>(first), among.end(), is_lower);
    }
  };
  const float scale = static_cast<float>(slices - 1) / (upper - lower);
  if (points.size() <= few || !(scale < std::numeric_limits<float>::max())) return select(points, count);
  const auto slice_of = [&](const Point& point) {
    return std::min<std::uint32_t>(static_cast<std::uint32_t>((point.at[axis] - lower) * scale), slices - 1);
  };
  std::array<std::uint32_t, slices> sizes{};
  for (const Point& point : points) ++sizes[slice_of(point)];
  std::size_t before = 0;
  std::uint32_t slice = 0;
  for (; before + sizes[slice] <= count && slice + 1 < slices; ++slice) before += sizes[slice];
  // By whether a point's slice is below, at or above that one.
  std::array<std::size_t, 3> next{0, before, before + sizes[slice]};
  moved_.resize(std::max(moved_.size(), points.size()));
  for (const Point& point : points) {
    const std::uint32_t mine = slice_of(point);
    moved_[next[(mine >= slice ? 1u : 0u) + (mine > slice ? 1u : 0u)]++] = point;
  }
  std::copy_n(moved_.begin(), points.size(), points.begin());
  select(points.subspan(before, sizes[slice]), count - before);
}

bool has_same_rows(const TreeOrder& order, std::span<const FrameObject> objects, std::size_t count) noexcept {
  return order.rows.size() == count && order.end <= objects.size() &&
         std::all_of(order.rows.begin(), order.rows.end(), [&](std::uint32_t row) { return objects[row].number != 0; });
}

bool adapt(const TreeOrder& before, std::span<const FrameObject> objects, std::size_t count, TreeOrder& out) {
  thread_local std::vector<bool> listed;
  listed.assign(objects.size(), false);
  out.cost = before.cost;
  out.end = static_cast<std::uint32_t>(objects.size());
  out.rows.clear();
  for (const std::uint32_t row : before.rows) {
    if (row >= objects.size() || objects[row].number == 0) continue;
    out.rows.push_back(row);
    listed[row] = true;
  }
  constexpr std::size_t most_new = 64;  // of so many, one
  if ((count - out.rows.size()) * most_new > count) return false;
  for (std::uint32_t row = 0; row < objects.size(); ++row) {
    if (objects[row].number != 0 && !listed[row]) out.rows.push_back(row);
  }
  return true;
}

}  // namespace ringfence::queries
