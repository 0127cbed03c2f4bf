#include "geometry/hull.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "ringfence/error.hpp"

using namespace ringfence;
using geometry::build_hull;
using geometry::Hull;

namespace {

using Points = std::vector<Vec3f>;

double extent(const Points& points) {
  Vec3d low{1e300, 1e300, 1e300}, high = -low;
  for (const Vec3f p : points) {
    low = {std::min(low.x, double{p.x}), std::min(low.y, double{p.y}), std::min(low.z, double{p.z})};
    high = {std::max(high.x, double{p.x}), std::max(high.y, double{p.y}), std::max(high.z, double{p.z})};
  }
  return std::max({high.x - low.x, high.y - low.y, high.z - low.z});
}

/// Checks that the plane of a face in fixed point is that in float within half of a unit, or one where it is limited.
void check_fixed_point_plane(const Hull& hull, std::size_t face) {
  const Vec3d normal = to_double(hull.normal(face));
  const double distance = double{hull.offset()[face]} - dot(normal, to_double(hull.centroid()));
  const double exact[4] = {normal.x, normal.y, normal.z, distance / double{hull.extent()}};
  const std::int16_t* const group =
      hull.fixed_point_planes() + face / geometry::fixed_point_lanes * 4 * geometry::fixed_point_lanes;
  for (std::size_t k = 0; k < 4; ++k) {
    const double units = group[k * geometry::fixed_point_lanes + face % geometry::fixed_point_lanes];
    REQUIRE(std::abs(units - exact[k] * 32768) <= (std::abs(units) == 32767 ? 1.01 : 0.51));
  }
}

/// Checks the properties that every hull must have.
void check_hull(const Hull& hull, const Points& points) {
  const double size = extent(points);
  // The rounding errors of float normals and offsets grow with the distance of the points from the origin.
  const double tolerance = 1e-6 * size + 2.5e-7 * double{hull.bounding_radius()};

  std::set<std::array<float, 3>> input_points;
  for (const Vec3f p : points) input_points.insert({p.x, p.y, p.z});
  std::set<std::array<float, 3>> vertices;
  for (std::size_t v = 0; v < hull.vertex_count(); ++v) {
    const Vec3f p = hull.vertex(v);
    REQUIRE_MESSAGE(input_points.count({p.x, p.y, p.z}) == 1, "vertex " << v << " is not a point of the input");
    REQUIRE(vertices.insert({p.x, p.y, p.z}).second);
    REQUIRE(length(to_double(p)) <= double{hull.bounding_radius()} * (1 + 1e-12));
  }

  double worst = 0, smallest_gap = std::numeric_limits<double>::infinity();
  for (std::size_t f = 0; f < hull.face_count(); ++f) {
    const Vec3d normal = to_double(hull.normal(f));
    REQUIRE(std::abs(length(normal) - 1) < 1e-6);
    double support = -1e300;
    for (std::size_t v = 0; v < hull.vertex_count(); ++v) {
      support = std::max(support, dot(normal, to_double(hull.vertex(v))));
    }
    REQUIRE(support <= double{hull.offset()[f]});
    REQUIRE(double{hull.offset()[f]} - support <= 2.5e-7 * (std::abs(support) + 1e-30));
    for (const Vec3f p : points) worst = std::max(worst, dot(normal, to_double(p)) - double{hull.offset()[f]});
    for (const std::uint16_t v : hull.face(f)) {
      REQUIRE(std::abs(dot(normal, to_double(hull.vertex(v))) - double{hull.offset()[f]}) <= 2 * tolerance);
    }
    smallest_gap = std::min(smallest_gap, double{hull.offset()[f]} - dot(normal, to_double(hull.centroid())));
    check_fixed_point_plane(hull, f);
  }
  double farthest = 0;
  for (std::size_t v = 0; v < hull.vertex_count(); ++v) {
    farthest = std::max(farthest, length(to_double(hull.vertex(v)) - to_double(hull.centroid())));
  }
  REQUIRE(farthest <= double{hull.extent()});
  REQUIRE(double{hull.extent()} <= farthest * (1 + 1e-6));
  REQUIRE_MESSAGE(worst <= tolerance, "a point lies " << worst << " outside a hull of size " << size);
  REQUIRE(smallest_gap > -tolerance);
  REQUIRE(double{hull.inner_radius()} <= smallest_gap + tolerance);

  REQUIRE(hull.vertex_count() + hull.face_count() == hull.edge_count() + 2);  // Euler's formula
  std::map<std::pair<int, int>, int> half_edges;
  for (std::size_t f = 0; f < hull.face_count(); ++f) {
    const auto face = hull.face(f);
    REQUIRE(face.size() >= 3);
    for (std::size_t i = 0; i < face.size(); ++i) {
      REQUIRE(half_edges.insert({{face[i], face[(i + 1) % face.size()]}, static_cast<int>(f)}).second);
    }
  }
  REQUIRE(half_edges.size() == 2 * hull.edge_count());
  for (std::size_t i = 0; i < hull.edge_count(); ++i) {
    const geometry::HullEdge& edge = hull.edges()[i];
    REQUIRE(half_edges.at({edge.from, edge.to}) == edge.left);
    REQUIRE(half_edges.at({edge.to, edge.from}) == edge.right);
    REQUIRE(hull.edge_ends(i).from == edge.from);
    REQUIRE(hull.edge_ends(i).to == edge.to);
  }

  for (std::size_t v = hull.vertex_count(); v < geometry::padded(hull.vertex_count()); ++v) {
    REQUIRE(hull.vertex(v) == hull.vertex(0));
  }
  REQUIRE(reinterpret_cast<std::uintptr_t>(hull.x()) % 64 == 0);
}

/// Checks that the input points and the hull have the same support function.
void check_support(const Hull& hull, const Points& points, std::mt19937& random) {
  std::normal_distribution<double> normal;
  const double size = extent(points);
  for (int i = 0; i < 50; ++i) {
    Vec3d d{normal(random), normal(random), normal(random)};
    d = d * (1 / length(d));
    double points_support = -1e300, hull_support = -1e300;
    for (const Vec3f p : points) points_support = std::max(points_support, dot(d, to_double(p)));
    for (std::size_t v = 0; v < hull.vertex_count(); ++v) {
      hull_support = std::max(hull_support, dot(d, to_double(hull.vertex(v))));
    }
    REQUIRE(hull_support <= points_support);
    REQUIRE(points_support - hull_support <= 2e-6 * size);
  }
}

Points ellipsoid(std::mt19937& random, std::size_t count, Vec3d radii, Vec3d centre = {}) {
  std::normal_distribution<double> normal;
  Points points;
  for (std::size_t i = 0; i < count; ++i) {
    Vec3d d{normal(random), normal(random), normal(random)};
    d = d * (1 / length(d));
    points.push_back(to_float(Vec3d{d.x * radii.x, d.y * radii.y, d.z * radii.z} + centre));
  }
  return points;
}

Points grid(int nx, int ny, int nz, float step) {
  Points points;
  for (int i = 0; i < nx; ++i) {
    for (int j = 0; j < ny; ++j) {
      for (int k = 0; k < nz; ++k) {
        points.push_back({static_cast<float>(i) * step, static_cast<float>(j) * step, static_cast<float>(k) * step});
      }
    }
  }
  return points;
}

Points rotated(const Points& points, std::mt19937& random, Vec3f by = {}) {
  std::normal_distribution<float> normal;
  const auto r =
      geometry::rotation(geometry::normalise({normal(random), normal(random), normal(random), normal(random)}));
  Points result;
  for (const Vec3f p : points) result.push_back(geometry::rotate(r, p) + by);
  return result;
}

}  // namespace

TEST_CASE("a hull of random points is closed, convex and contains all of them") {
  for (unsigned seed = 0; seed < 600; ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> axis(-3, 0.5);
    const Vec3d radii{std::pow(10, axis(random)), std::pow(10, axis(random)), std::pow(10, axis(random))};
    const std::size_t count = 4 + random() % 120;
    Points points = ellipsoid(random, count, radii, {axis(random), axis(random), axis(random)});
    if (seed % 2 == 0) {
      for (Vec3f& p : points) p = p * (static_cast<float>(random() % 1000) / 1000.0f);
    }
    Hull hull;
    try {
      hull = build_hull(points);
    } catch (const Error& error) {
      REQUIRE_MESSAGE((count < 8 || std::string(error.what()).find("plane") != std::string::npos), error.what());
      continue;
    }
    check_hull(hull, points);
    check_support(hull, points, random);
  }
}

TEST_CASE("32 points on a sphere are all vertices, and all faces are triangles") {
  std::mt19937 random(5);
  for (int i = 0; i < 50; ++i) {
    const Points points = ellipsoid(random, 32, {0.6, 0.9, 1.2});
    const Hull hull = build_hull(points);
    check_hull(hull, points);
    CHECK(hull.vertex_count() == 32);
    CHECK(hull.face_count() == 60);
    CHECK(hull.edge_count() == 90);
  }
}

TEST_CASE("a grid of points, rotated or not, becomes a box of 8 vertices and 6 faces") {
  std::mt19937 random(7);
  for (const auto& [nx, ny, nz] :
       {std::array{2, 2, 2}, std::array{5, 5, 5}, std::array{21, 21, 21}, std::array{9, 2, 3}}) {
    const Points points = grid(nx, ny, nz, 0.25f);
    for (int turn = 0; turn < 8; ++turn) {
      const Points turned = turn == 0 ? points : rotated(points, random, {0.3f, -0.2f, 0.1f});
      const Hull hull = build_hull(turned);
      check_hull(hull, turned);
      CHECK(hull.vertex_count() == 8);
      CHECK(hull.face_count() == 6);
      CHECK(hull.edge_count() == 12);
      const double volume = 0.015625 * (nx - 1) * (ny - 1) * (nz - 1);
      CHECK(hull.volume() == doctest::Approx(volume).epsilon(1e-5));
    }
  }
}

TEST_CASE("the flat ends of prisms and cylinders are single faces") {
  std::mt19937 random(11);
  for (int sides : {3, 5, 16, 64, 128}) {
    Points points;
    for (int i = 0; i < sides; ++i) {
      const double angle = 2 * 3.14159265358979 * i / sides;
      for (double z : {-152.4, 152.4}) {
        points.push_back(to_float({4630 * std::cos(angle), 4630 * std::sin(angle), z}));
      }
    }
    for (int turn = 0; turn < 4; ++turn) {
      const Points turned = turn == 0 ? points : rotated(points, random);
      const Hull hull = build_hull(turned);
      check_hull(hull, turned);
      CHECK(hull.vertex_count() == 2 * static_cast<std::size_t>(sides));
      CHECK(hull.face_count() == 2 + static_cast<std::size_t>(sides));
    }
  }
}

TEST_CASE("needles, plates and points far from the origin have valid hulls") {
  for (unsigned seed = 0; seed < 200; ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (const Vec3d radii : {Vec3d{1, 0.0005, 0.0005}, Vec3d{1, 1, 0.0005}, Vec3d{1000, 0.05, 0.05}, Vec3d{1, 1, 1}}) {
      const Vec3d centre = seed % 2 != 0 ? Vec3d{} : Vec3d{100, -50, 20};
      const Points points = rotated(ellipsoid(random, 60, radii, centre), random);
      check_hull(build_hull(points), points);
    }
  }
}

TEST_CASE("duplicate points and interior points do not change the hull") {
  std::mt19937 random(3);
  for (int round = 0; round < 50; ++round) {
    const Points once = ellipsoid(random, 30, {1, 0.8, 0.7});
    Points many = once;
    for (int i = 0; i < 200; ++i) many.push_back(once[random() % once.size()]);
    for (int i = 0; i < 200; ++i) many.push_back(once[random() % once.size()] * 0.5f);
    const Hull p = build_hull(once), q = build_hull(many);
    check_hull(q, many);
    CHECK(p.vertex_count() == q.vertex_count());
    CHECK(p.volume() == doctest::Approx(q.volume()).epsilon(1e-6));
  }
}

TEST_CASE("ten thousand nearly coplanar and nearly duplicate points have a valid hull") {
  std::mt19937 random(13);
  std::uniform_real_distribution<float> unit(-1, 1);
  Points points;
  for (int i = 0; i < 10000; ++i) {
    // The point is at most 10^-7 from a face of a cube. So each face has many points that are nearly coplanar.
    Vec3f p{unit(random), unit(random), unit(random)};
    const int face = i % 6;
    const float side = (face & 1 ? 1.0f : -1.0f) * (1.0f + 1e-7f * unit(random));
    (face / 2 == 0 ? p.x : face / 2 == 1 ? p.y : p.z) = side;
    points.push_back(p);
  }
  for (int i = 0; i < 8; ++i) {
    points.push_back({i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f});
  }
  const Hull hull = build_hull(points);
  check_hull(hull, points);
  CHECK(hull.vertex_count() == 8);
}

TEST_CASE("points that span no solid are refused with the reason") {
  const auto reason = [](const Points& points) -> std::string {
    try {
      build_hull(points);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  CHECK(reason({}).find("no points") != std::string::npos);
  CHECK(reason({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}).find("3 distinct") != std::string::npos);
  CHECK(reason({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, 0}, {1, 0, 0}}).find("3 distinct") != std::string::npos);
  CHECK(reason({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}}).find("1 distinct") != std::string::npos);
  CHECK(reason({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}).find("plane") != std::string::npos);
  CHECK(reason({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.3f, 0.2f, 1e-7f}}).find("plane") != std::string::npos);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  CHECK(reason({{0, 0, 0}, {1, 0, 0}, {0, nan, 0}, {1, 1, 1}}).find("point 2 is not finite") != std::string::npos);
  std::mt19937 random(19);
  CHECK(reason(ellipsoid(random, 257, {1, 1, 1})).find("257 vertices") != std::string::npos);
  CHECK(reason(ellipsoid(random, 256, {1, 1, 1})).empty());
}
