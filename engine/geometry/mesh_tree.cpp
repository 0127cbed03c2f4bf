#include "geometry/mesh_tree.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_invoke.h>

#include "geometry/vector.hpp"

namespace ringfence::geometry {
namespace {

constexpr std::uint32_t fan = tree_fanout;
/// Below this many triangles a task costs more than it saves.
constexpr std::size_t least_task = 8192;

struct Box {
  Vec3f low{std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
            std::numeric_limits<float>::infinity()};
  Vec3f high{-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
             -std::numeric_limits<float>::infinity()};

  void hold(Vec3f p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  void hold(const Box& box) { hold(box.low), hold(box.high); }
};

/// What sorting moves: a triangle's number and three times its centre.
struct Entry {
  float centre[3];
  std::uint32_t triangle;
};

/// Puts `entries` in the order of the leaves. Each half is a set that does not depend on how it was found: the order
/// by centre and number has no ties.
void arrange(std::span<Entry> entries) {
  while (entries.size() > fan) {
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
    std::size_t chunk = fan;
    while (chunk * fan < entries.size()) chunk *= fan;
    const std::size_t chunks = (entries.size() + chunk - 1) / chunk;
    const std::size_t half = (chunks + 1) / 2 * chunk;
    std::nth_element(entries.begin(), entries.begin() + static_cast<std::ptrdiff_t>(half), entries.end(),
                     [axis](const Entry& p, const Entry& q) {
                       return p.centre[axis] != q.centre[axis] ? p.centre[axis] < q.centre[axis]
                                                               : p.triangle < q.triangle;
                     });
    const std::span<Entry> front = entries.first(half), back = entries.subspan(half);
    if (entries.size() >= least_task) {
      oneapi::tbb::parallel_invoke([front] { arrange(front); }, [back] { arrange(back); });
      return;
    }
    arrange(front);
    entries = back;
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& p, const Entry& q) { return p.triangle < q.triangle; });
}

Vec3f unit_normal(Vec3f p, Vec3f q, Vec3f r) {
  const Vec3d normal = cross(to_double(q) - to_double(p), to_double(r) - to_double(p));
  return to_float(normal * (1 / length(normal)));
}

/// Centre and half extents of a box, the latter so that they hold it from the rounded centre.
void write(const Box& box, BoxGroup& group, std::size_t lane) {
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

constexpr std::size_t groups_of(std::size_t nodes) { return (nodes + fan - 1) / fan; }

}  // namespace

MeshTree::MeshTree(std::span<const Vec3f> vertices, std::span<const std::array<std::uint32_t, 3>> triangles) {
  assert(!triangles.empty());
  using Range = oneapi::tbb::blocked_range<std::size_t>;
  std::vector<Entry> order(triangles.size());
  oneapi::tbb::parallel_for(Range(0, order.size(), least_task), [&](const Range& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) {
      const auto& t = triangles[i];
      const Vec3f sum = vertices[t[0]] + vertices[t[1]] + vertices[t[2]];
      order[i] = {{sum.x, sum.y, sum.z}, static_cast<std::uint32_t>(i)};
    }
  });
  arrange(order);

  std::size_t groups = 0;
  for (std::size_t nodes = groups_of(order.size());; nodes = groups_of(nodes)) {
    levels_.push_back({nodes, groups});
    groups += groups_of(nodes);
    if (nodes == 1) break;
  }
  assert(levels_.size() <= max_tree_levels);
  leaves_.resize(levels_[0].nodes);
  boxes_.assign(groups, no_boxes());

  std::vector<Box> below(levels_[0].nodes);
  oneapi::tbb::parallel_for(Range(0, leaves_.size(), least_task / fan), [&](const Range& range) {
    for (std::size_t leaf = range.begin(); leaf != range.end(); ++leaf) {
      for (std::size_t lane = 0; lane < fan; ++lane) {
        const std::uint32_t number = order[std::min(leaf * fan + lane, order.size() - 1)].triangle;
        const auto& t = triangles[number];
        TriangleGroup& to = leaves_[leaf];
        for (std::size_t c = 0; c < 3; ++c) {
          const Vec3f p = vertices[t[c]];
          to.corner[c][0][lane] = p.x;
          to.corner[c][1][lane] = p.y;
          to.corner[c][2][lane] = p.z;
          below[leaf].hold(p);
        }
        const Vec3f normal = unit_normal(vertices[t[0]], vertices[t[1]], vertices[t[2]]);
        to.normal[0][lane] = normal.x;
        to.normal[1][lane] = normal.y;
        to.normal[2][lane] = normal.z;
        to.index[lane] = number;
      }
    }
  });
  for (const Level& level : levels_) {
    std::vector<Box> above(groups_of(level.nodes));
    for (std::size_t i = 0; i < level.nodes; ++i) {
      write(below[i], boxes_[level.first_group + i / fan], i % fan);
      above[i / fan].hold(below[i]);
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
  std::array<Open, fan * max_tree_levels> stack;
  std::size_t open = 0;
  stack[open++] = {root(), std::numeric_limits<double>::infinity()};
  while (open > 0) {
    const Open next = stack[--open];
    if (next.bound <= best) continue;
    if (next.node.level == 0) {
      const TriangleGroup& leaf = leaves_[next.node.index];
      for (std::size_t lane = 0; lane < fan; ++lane) {
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
      // Wider by far than what rounding in double can hide.
      const double bound = (dot(direction, centre) + dot(spread, half)) + 1e-14 * dot(spread, far);
      if (bound > best) stack[open++] = {{level, static_cast<std::uint32_t>(first + lane)}, bound};
    }
    std::sort(stack.begin() + static_cast<std::ptrdiff_t>(from), stack.begin() + static_cast<std::ptrdiff_t>(open),
              [](const Open& p, const Open& q) { return p.bound < q.bound; });
  }
  return best;
}

}  // namespace ringfence::geometry
