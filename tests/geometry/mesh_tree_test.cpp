#include "geometry/mesh_tree.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <set>
#include <string>
#include <thread>

#include <doctest/doctest.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include "base/caller_environment.hpp"
#include "base/floating_point.hpp"
#include "geometry/mesh.hpp"
#include "geometry/support_table.hpp"
#include "geometry/vector.hpp"

using namespace ringfence;
using namespace ringfence::geometry;

namespace {

/// Triangles of similar size distributed over a cube, some of them slivers.
TriangleMesh cloud(std::size_t triangles, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> place(-1, 1);
  const auto point = [&] { return Vec3f{place(random), place(random), place(random)}; };
  TriangleMesh mesh;
  for (std::size_t i = 0; i < triangles; ++i) {
    const Vec3f p = point();
    for (const Vec3f& q : {p, p + point() * 0.1f, p + point() * 0.1f}) {
      mesh.indices.push_back(static_cast<std::uint32_t>(mesh.vertices.size()));
      mesh.vertices.push_back(q);
    }
  }
  return mesh;
}

template <class T>
bool same_bits(std::span<const T> p, std::span<const T> q) {
  return p.size() == q.size() && std::memcmp(p.data(), q.data(), p.size_bytes()) == 0;
}

}  // namespace

TEST_CASE("a tree contains every triangle once, and its boxes on every level contain it") {
  for (const std::size_t count : {1u, 2u, 4u, 5u, 16u, 17u, 63u, 64u, 65u, 255u, 320u, 1025u, 5000u}) {
    CAPTURE(count);
    const Mesh mesh(cloud(count, count));
    const MeshTree& tree = mesh.tree();
    std::set<std::uint32_t> seen;
    bool contained = true;
    for (std::uint32_t i = 0; i < tree.leaves().size(); ++i) {
      const TriangleGroup& leaf = tree.leaf(i);
      for (std::size_t lane = 0; lane < tree_fanout; ++lane) {
        if (i + 1 < tree.leaves().size()) CHECK(seen.insert(leaf.index[lane]).second);
        seen.insert(leaf.index[lane]);
        const auto& triangle = mesh.triangles()[leaf.index[lane]];
        for (std::size_t c = 0; c < 3; ++c) {
          const Vec3f p = mesh.vertices()[triangle[c]];
          contained &= p == Vec3f{leaf.corner[c][0][lane], leaf.corner[c][1][lane], leaf.corner[c][2][lane]};
          const double at[3] = {double{p.x}, double{p.y}, double{p.z}};
          std::uint32_t index = i;
          for (std::uint32_t level = 0; level <= tree.root().level; ++level, index /= 4) {
            const BoxGroup& group = tree.boxes_with({level, index});
            for (std::size_t k = 0; k < 3; ++k) {
              contained &= std::abs(at[k] - double{group.centre[k][index % 4]}) <= double{group.half[k][index % 4]};
            }
          }
        }
      }
    }
    CHECK(contained);
    CHECK(seen.size() == count);
    CHECK(tree.nodes(tree.root().level) == 1);
  }
}

TEST_CASE("an unused lane has a box that nothing overlaps") {
  const Mesh mesh(cloud(5, 3));
  const BoxGroup& top = mesh.tree().boxes_with(mesh.tree().root());
  for (std::size_t lane = 1; lane < tree_fanout; ++lane) {
    for (std::size_t k = 0; k < 3; ++k) CHECK(top.half[k][lane] < -1e29f);
  }
}

TEST_CASE("a tree is the same for any number of threads that build it") {
  const TriangleMesh description = cloud(60'000, 7);
  const Mesh expected(description);
  const Rotation r = rotation(Quat{0.5f, 0.5f, -0.5f, 0.5f});
  Vec3d low, high;
  expected.extent(r, low, high);
  for (const int threads : {1, 2, 3, 7}) {
    CAPTURE(threads);
    oneapi::tbb::global_control control(oneapi::tbb::global_control::max_allowed_parallelism, 8);
    oneapi::tbb::task_arena arena(threads);
    arena.execute([&] {
      const Mesh mesh(description);
      CHECK(same_bits(mesh.tree().leaves(), expected.tree().leaves()));
      CHECK(same_bits(mesh.tree().all_boxes(), expected.tree().all_boxes()));
      Vec3d lower, upper;
      mesh.extent(r, lower, upper);
      CHECK(lower == low);
      CHECK(upper == high);
    });
  }
}

TEST_CASE("a tree is the same whatever the environment in which its thread first used oneTBB") {
  const TriangleMesh description = cloud(20'000, 8);
  const Mesh expected(description);
  const Rotation r = rotation(Quat{0.5f, 0.5f, -0.5f, 0.5f});
  Vec3d low, high;
  expected.extent(r, low, high);
  for (const test::Caller caller : {test::Caller::flushing, test::Caller::rounding_up}) {
    CAPTURE(std::string(name_of(caller)));
    std::thread([&] {
      const test::CallerEnvironment environment(caller);
      oneapi::tbb::parallel_for(0, 1, [](int) {});
      const base::DefaultFloatingPoint floating_point;
      const Mesh mesh(description);
      CHECK(same_bits(mesh.tree().leaves(), expected.tree().leaves()));
      CHECK(same_bits(mesh.tree().all_boxes(), expected.tree().all_boxes()));
      Vec3d lower, upper;
      mesh.extent(r, lower, upper);
      CHECK(lower == low);
      CHECK(upper == high);
    }).join();
  }
}

TEST_CASE("the tree's support is the maximum over all corners") {
  const Mesh mesh(cloud(700, 11));
  std::mt19937_64 random(12);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 200; ++i) {
    const Vec3d direction{normal(random), normal(random), i % 5 == 0 ? 0.0 : normal(random)};
    double largest = -1e300;
    for (const Vec3f& p : mesh.vertices()) largest = std::max(largest, dot(direction, to_double(p)));
    CHECK(mesh.tree().support(direction) == largest);
  }
}

TEST_CASE("the extent of a rotated mesh contains it and is at most slightly larger") {
  std::mt19937_64 random(13);
  std::normal_distribution<float> normal;
  const Mesh mesh(cloud(700, 14));
  double largest_error = 0;
  for (int i = 0; i < 500; ++i) {
    const Quat q = i == 0 ? Quat{} : normalise({normal(random), normal(random), normal(random), normal(random)});
    const Rotation r = rotation(q);
    Vec3d lower, upper;
    mesh.extent(r, lower, upper);
    const double low[3] = {lower.x, lower.y, lower.z}, high[3] = {upper.x, upper.y, upper.z};
    for (int k = 0; k < 3; ++k) {
      const Vec3d axis{double{r.m[k][0]}, double{r.m[k][1]}, double{r.m[k][2]}};
      double smallest = 1e300, largest = -1e300;
      for (const Vec3f& p : mesh.vertices()) {
        smallest = std::min(smallest, dot(axis, to_double(p)));
        largest = std::max(largest, dot(axis, to_double(p)));
      }
      CHECK(low[k] <= smallest);
      CHECK(high[k] >= largest);
      largest_error = std::max({largest_error, smallest - low[k], high[k] - largest});
      // Along its own axes, a mesh's support is exact.
      if (i == 0) CHECK(high[k] - largest < 1e-6);
    }
  }
  CHECK(largest_error < 0.03 * double{mesh.bounding_radius()});
}
