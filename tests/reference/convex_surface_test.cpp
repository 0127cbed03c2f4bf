#include "reference/convex_surface.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "reference/core.hpp"
#include "reference/exact.hpp"
#include "reference/random_shapes.hpp"

using namespace ringfence;
using namespace ringfence::reference;
using reference_test::Random;

namespace {

/// Exact checks: the surface is closed, every edge has two faces, no point lies in front of any face, and Euler's
/// formula holds.
void expect_convex(const ConvexSurface& surface, const std::vector<Vector>& given) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  std::vector<std::uint32_t> used;
  for (const auto& f : surface.faces()) {
    for (int i = 0; i < 3; ++i) ++edges[{f.vertices[i], f.vertices[(i + 1) % 3]}];
    used.insert(used.end(), f.vertices, f.vertices + 3);
    const auto p = [&](int i) { return surface.points()[f.vertices[i]]; };
    CHECK(std::none_of(given.begin(), given.end(),
                       [&](const Vector& v) { return orientation(p(0), p(1), p(2), v) > 0; }));
  }
  for (const auto& [edge, count] : edges) {
    CHECK(count == 1);
    CHECK(edges.count({edge.second, edge.first}) == 1);
  }
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  CHECK(used.size() - edges.size() / 2 + surface.faces().size() == 2);
}

std::vector<Vector> doubles(const ConvexHull& hull) {
  std::vector<Vector> out;
  for (const Vec3f& p : hull.points) out.emplace_back(p);
  return out;
}

}  // namespace

TEST_CASE("orientation is exact where double arithmetic is not") {
  const Vector a{0, 0, 0}, b{1, 0, 0}, c{0, 1, 0};
  CHECK(orientation(a, b, c, {0, 0, 1}) == 1);
  CHECK(orientation(a, b, c, {0, 0, -1}) == -1);
  CHECK(orientation(a, b, c, {5, 7, 0}) == 0);
  CHECK(orientation(a, b, c, {5, 7, 1e-60}) == 1);
  // Four points of the plane x + y + z = 1 with short binary fractions; later one of them is moved by the last bit.
  const Vector p{0.375, 0.25, 0.375}, q{0x1p-20, 1 - 0x1p-20, 0}, r{0x1p-30, 0, 1 - 0x1p-30};
  Vector s{1 - 0x1p-20 - 0x1p-30, 0x1p-20, 0x1p-30};
  CHECK(orientation(p, q, r, s) == 0);
  const int up = orientation(p, q, r, {1, 1, 1});
  CHECK(up != 0);
  s.x = std::nextafter(s.x, 2);
  CHECK(orientation(p, q, r, s) == up);
  s.x -= 0x1p-52;
  CHECK(orientation(p, q, r, s) == -up);
}

TEST_CASE("the sign of an orientation follows the order of the points") {
  for (const std::uint64_t seed : {51u, 2051u}) {  // with 2051 the largest components of a sum cancel
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 2000; ++i) {
      CAPTURE(i);
      // Nearly coplanar points, far from the origin.
      const Vector u = random.direction(), v = random.direction(), base = random.direction() * 1e6;
      const auto place = [&] { return base + u * random.uniform(-1, 1) + v * random.uniform(-1, 1); };
      const Vector a = place(), b = place(), c = place(), d = place();
      const int o = orientation(a, b, c, d);
      CHECK(orientation(b, c, a, d) == o);
      CHECK(orientation(b, a, c, d) == -o);
      CHECK(orientation(a, b, d, c) == -o);
      CHECK(orientation(d, c, b, a) == o);
    }
  }
}

TEST_CASE("the hull of any points is exactly closed and convex") {
  const std::uint64_t seed = 52;
  CAPTURE(seed);
  Random random(seed);
  for (int i = 0; i < 300; ++i) {
    CAPTURE(i);
    const auto points =
        doubles(i % 3 ? random.degenerate_hull(random.size(1e-3, 1e5)) : random.hull(1, 4 + random.below(250)));
    const auto surface = ConvexSurface::around(points);
    REQUIRE(surface);
    expect_convex(*surface, points);
  }
}

TEST_CASE("coplanar points and fewer than four points have no hull") {
  std::vector<Vector> points;
  CHECK(!ConvexSurface::around(points));
  for (int i = 0; i < 30; ++i) points.push_back({i * 0.125, i * i * 0.25, 3 - i * 0.125 - i * i * 0.25});
  CHECK(!ConvexSurface::around(points));
  points.push_back({0, 0, std::nextafter(3.0, 4.0)});
  CHECK(ConvexSurface::around(points));
  CHECK_THROWS_AS(hull_core(std::vector<Vec3f>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}), std::invalid_argument);
}

TEST_CASE("a lattice in a cube has the six faces and twelve edges of the cube") {
  ConvexHull lattice;
  for (int i = 0; i < 125; ++i) {
    lattice.points.push_back({static_cast<float>(i % 5), static_cast<float>(i / 5 % 5), static_cast<float>(i / 25)});
  }
  const Core core = hull_core(lattice.points);
  CHECK(core.normals.size() == 6);
  double length_of_edges = 0;
  for (const auto& s : core.segments) length_of_edges += length(core.vertices[s[1]] - core.vertices[s[0]]);
  CHECK(length_of_edges == doctest::Approx(12 * 4));
}

TEST_CASE("every face of a core has at least three edges and supports the core") {
  const std::uint64_t seed = 53;
  CAPTURE(seed);
  Random random(seed);
  for (int i = 0; i < 300; ++i) {
    CAPTURE(i);
    Core core;
    if (i % 5 == 0) {
      set_triangle(core, random.direction(), random.direction(), random.direction());
    } else {
      core = core_of(random.convex(1));
    }
    std::vector<int> edges(core.normals.size());
    for (const auto& arc : core.arcs) {
      for (const std::uint32_t f : arc.faces) {
        ++edges[f];
        // An edge lies in both of its faces.
        CHECK(std::abs(dot(core.normals[f], arc.direction)) < 1e-9);
        CHECK(std::abs(dot(core.normals[f], arc.point) - core.offsets[f]) < 1e-9 * (1 + core.reach));
      }
    }
    CHECK(*std::min_element(edges.begin(), edges.end()) >= 3);
  }
}
