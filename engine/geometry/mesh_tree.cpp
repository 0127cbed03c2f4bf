#include "geometry/mesh_tree.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.hpp"
#include "geometry/vector.hpp"

namespace ringfence::geometry {
namespace {

constexpr std::uint32_t fanout = tree_fanout;
/// With fewer triangles, starting a task costs more than it saves.
constexpr std::size_t min_task_triangles = 8192;

struct CornerBox {
  Vec3f low{std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
            std::numeric_limits<float>::infinity()};
  Vec3f high{-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
             -std::numeric_limits<float>::infinity()};

  void extend(Vec3f p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  void extend(const CornerBox& box) { extend(box.low), extend(box.high); }
};

/// The sort entry of a triangle: its number and three times its centre.
struct Entry {
  float centre[3];
  std::uint32_t triangle;
};

/// Sorts `entries` into the order of the leaves. Each half is a unique set, because the order by centre and number has
/// no ties; so the result does not depend on the number of threads.
void sort_leaves(std::span<Entry> entries) {
  while (entries.size() > fanout) {
    float low[3], high[3];
    std::fill(std::begin(low), std::end(low), std::numeric_limits<float>::infinity());
    std::fill(std::begin(high), std::end(high), -std::numeric_limits<float>::infinity());
    for (const Entry& e : entries) {
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], e.centre[k]);
        high[k] = std::max(high[k], e.centre[k]);
      }
    }
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
      if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    }
    std::size_t chunk = fanout;
    while (chunk * fanout < entries.size()) chunk *= fanout;
    const std::size_t chunks = (entries.size() + chunk - 1) / chunk;
    const std::size_t half = (chunks + 1) / 2 * chunk;
    std::nth_element(entries.begin(), entries.begin() + static_cast<std::ptrdiff_t>(half), entries.end(),
                     [axis](const Entry& p, const Entry& q) {
                       return p.centre[axis] != q.centre[axis] ? p.centre[axis] < q.centre[axis]
                                                               : p.triangle < q.triangle;
                     });
    const std::span<Entry> front = entries.first(half), back = entries.subspan(half);
    if (entries.size() >= min_task_triangles) {
      base::parallel_invoke([front] { sort_leaves(front); }, [back] { sort_leaves(back); });
      return;
    }
    sort_leaves(front);
    entries = back;
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& p, const Entry& q) { return p.triangle < q.triangle; });
}

Vec3f unit_normal(Vec3f p, Vec3f q, Vec3f r) {
  const Vec3d normal = cross(to_double(q) - to_double(p), to_double(r) - to_double(p));
  return to_float(normal * (1 / length(normal)));
}

/// Stores the centre and half extents of a box. The half extents are rounded so that they cover the box from the
/// rounded centre.
void write(const CornerBox& box, BoxGroup& group, std::size_t lane) {
  const float low[3] = {box.low.x, box.low.y, box.low.z}, high[3] = {box.high.x, box.high.y, box.high.z};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto centre = static_cast<float>(0.5 * (double{low[k]} + double{high[k]}));
    const double half = std::max(double{high[k]} - double{centre}, double{centre} - double{low[k]});
    group.centre[k][lane] = centre;
    group.half[k][lane] = std::nextafter(static_cast<float>(half), std::numeric_limits<float>::infinity());
  }
}

BoxGroup no_boxes() {
  BoxGroup group;
  for (std::size_t k = 0; k < 3; ++k) {
    std::fill(std::begin(group.centre[k]), std::end(group.centre[k]), 0.0f);
    std::fill(std::begin(group.half[k]), std::end(group.half[k]), -1e30f);
  }
  return group;
}

constexpr std::size_t groups_of(std::size_t nodes) { return (nodes + fanout - 1) / fanout; }

}  // namespace

MeshTree::MeshTree(std::span<const Vec3f> vertices, std::span<const std::array<std::uint32_t, 3>> triangles) {
  assert(!triangles.empty());
  std::vector<Entry> order(triangles.size());
  base::parallel_for(order.size(), min_task_triangles, [&](std::size_t i) {
    const auto& t = triangles[i];
    const Vec3f sum = vertices[t[0]] + vertices[t[1]] + vertices[t[2]];
    order[i] = {{sum.x, sum.y, sum.z}, static_cast<std::uint32_t>(i)};
  });
  sort_leaves(order);

  std::size_t groups = 0;
  for (std::size_t nodes = groups_of(order.size());; nodes = groups_of(nodes)) {
    levels_.push_back({nodes, groups});
    groups += groups_of(nodes);
    if (nodes == 1) break;
  }
  assert(levels_.size() <= max_tree_levels);
  leaves_.resize(levels_[0].nodes);
  boxes_.assign(groups, no_boxes());

  std::vector<CornerBox> below(levels_[0].nodes);
  base::parallel_for(leaves_.size(), min_task_triangles / fanout, [&](std::size_t leaf) {
    for (std::size_t lane = 0; lane < fanout; ++lane) {
      const std::uint32_t number = order[std::min(leaf * fanout + lane, order.size() - 1)].triangle;
      const auto& t = triangles[number];
      TriangleGroup& to = leaves_[leaf];
      for (std::size_t c = 0; c < 3; ++c) {
        const Vec3f p = vertices[t[c]];
        to.corner[c][0][lane] = p.x;
        to.corner[c][1][lane] = p.y;
        to.corner[c][2][lane] = p.z;
        below[leaf].extend(p);
      }
      const Vec3f normal = unit_normal(vertices[t[0]], vertices[t[1]], vertices[t[2]]);
      to.normal[0][lane] = normal.x;
      to.normal[1][lane] = normal.y;
      to.normal[2][lane] = normal.z;
      to.index[lane] = number;
    }
  });
  for (const Level& level : levels_) {
    std::vector<CornerBox> above(groups_of(level.nodes));
    for (std::size_t i = 0; i < level.nodes; ++i) {
      write(below[i], boxes_[level.first_group + i / fanout], i % fanout);
      above[i / fanout].extend(below[i]);
    }
    below = std::move(above);
  }
}

double MeshTree::support(Vec3d direction) const noexcept {
  const Vec3d spread{std::abs(direction.x), std::abs(direction.y), std::abs(direction.z)};
  double best = -std::numeric_limits<double>::infinity();
  struct Open {
    TreeNode node;
    double bound;
  };
  std::array<Open, fanout * max_tree_levels> stack;
  std::size_t open = 0;
  stack[open++] = {root(), std::numeric_limits<double>::infinity()};
  while (open > 0) {
    const Open next = stack[--open];
    if (next.bound <= best) continue;
    if (next.node.level == 0) {
      const TriangleGroup& leaf = leaves_[next.node.index];
      for (std::size_t lane = 0; lane < fanout; ++lane) {
        for (const auto& corner : leaf.corner) {
          best = std::max(best,
                          dot(direction, {double{corner[0][lane]}, double{corner[1][lane]}, double{corner[2][lane]}}));
        }
      }
      continue;
    }
    const std::uint32_t level = next.node.level - 1;
    const BoxGroup& group = boxes(level, next.node.index);
    const std::size_t first = next.node.index * tree_fanout, count = std::min(tree_fanout, nodes(level) - first);
    const std::size_t from = open;
    for (std::size_t lane = 0; lane < count; ++lane) {
      const Vec3d centre{double{group.centre[0][lane]}, double{group.centre[1][lane]}, double{group.centre[2][lane]}};
      const Vec3d half{double{group.half[0][lane]}, double{group.half[1][lane]}, double{group.half[2][lane]}};
      const Vec3d far{std::abs(centre.x) + half.x, std::abs(centre.y) + half.y, std::abs(centre.z) + half.z};
      // The margin is far larger than the rounding error in double.
      const double bound = (dot(direction, centre) + dot(spread, half)) + 1e-14 * dot(spread, far);
      if (bound > best) stack[open++] = {{level, static_cast<std::uint32_t>(first + lane)}, bound};
    }
    std::sort(stack.begin() + static_cast<std::ptrdiff_t>(from), stack.begin() + static_cast<std::ptrdiff_t>(open),
              [](const Open& p, const Open& q) { return p.bound < q.bound; });
  }
  return best;
}

}  // namespace ringfence::geometry
