#include "geometry/shape_table.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/ellipsoid.hpp"
#include "geometry/every_target.hpp"
#include "geometry/vector.hpp"
#include "ringfence/error.hpp"

using namespace ringfence;
using namespace ringfence::geometry;

namespace {

std::vector<Vec3f> ball_of_points(std::mt19937& random, std::size_t count, double radius) {
  std::normal_distribution<double> normal;
  std::vector<Vec3f> points;
  for (std::size_t i = 0; i < count; ++i) {
    Vec3d d{normal(random), normal(random), normal(random)};
    points.push_back(to_float(d * (radius / length(d))));
  }
  return points;
}

double exact_support(const ShapeTable& table, ShapeNumber shape, Vec3d d) {
  const ShapeDescription& description = table.description(shape);
  const auto over = [&](const std::vector<Vec3f>& points) {
    double largest = -1e300;
    for (const Vec3f p : points) largest = std::max(largest, dot(d, to_double(p)));
    return largest;
  };
  if (const auto* s = std::get_if<Sphere>(&description)) return double{s->radius} * length(d);
  if (const auto* b = std::get_if<Box>(&description)) {
    return std::abs(d.x) * b->half_extents.x + std::abs(d.y) * b->half_extents.y + std::abs(d.z) * b->half_extents.z;
  }
  if (const auto* c = std::get_if<Capsule>(&description)) {
    return std::abs(d.z) * c->half_height + double{c->radius} * length(d);
  }
  if (const auto* h = std::get_if<ConvexHull>(&description)) return over(h->points);
  if (const auto* m = std::get_if<TriangleMesh>(&description)) return over(m->vertices);
  return dot(d, to_double(std::get<SupportShape>(description).function->support(to_float(d))));
}

std::string refusal(const ShapeDescription& shape) {
  ShapeTable table;
  try {
    table.add(shape);
  } catch (const Error& error) {
    CHECK(table.size() == 0);
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("the bounds of every kind of shape contain it and are tight, near the origin and far from it") {
  std::mt19937 random(1);
  ShapeTable table;
  table.add(Sphere{0.7f});
  table.add(Box{{0.5f, 0.0005f, 2.0f}});
  table.add(Box{{100.0f, 300.0f, 20.0f}});
  table.add(Capsule{0.3f, 1.1f});
  for (const std::size_t count : {4u, 8u, 32u, 100u, 256u}) table.add(ConvexHull{ball_of_points(random, count, 1.3)});
  table.add(SupportShape{std::make_shared<test::Ellipsoid>(Vec3f{0.5f, 1.0f, 2.0f})});
  table.add(TriangleMesh{ball_of_points(random, 9, 1.0), {0, 1, 2, 3, 4, 5, 6, 7, 8}});

  std::normal_distribution<float> normal;
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const double side : {50.0, 1e4, 1e7}) {
    const FixedSpace space({-side - 400, -side - 400, -side - 400}, {side + 400, side + 400, side + 400});
    for (ShapeNumber shape = 0; shape < table.size(); ++shape) {
      CAPTURE(shape);
      const bool is_mesh = table.row(shape).kind == ShapeKind::mesh;
      for (int i = 0; i < 300; ++i) {
        const Pose pose{{unit(random) * side, unit(random) * side, unit(random) * side},
                        normalise({normal(random), normal(random), normal(random), normal(random)})};
        const Bounds bounds = table.bounds(shape, pose, space);
        const RotationD r = rotation_double(pose.orientation);
        const double position[3] = {pose.position.x, pose.position.y, pose.position.z};
        for (int axis = 0; axis < 3; ++axis) {
          const Vec3d row{r.m[axis][0], r.m[axis][1], r.m[axis][2]};
          const double low = position[axis] - exact_support(table, shape, -row);
          const double high = position[axis] + exact_support(table, shape, row);
          const double step = 1 / space.scale().x;
          const double at = bounds.lower[axis] * step + space.min().x, to = bounds.upper[axis] * step + space.min().x;
          const double rounding = side * 1e-15;
          const double slack = 3 * step + 3e-6 * table.row(shape).bounding_radius + rounding;
          REQUIRE(at <= low + rounding);
          REQUIRE(to >= high - rounding);
          if (!is_mesh) REQUIRE(at >= low - slack);
          if (!is_mesh) REQUIRE(to <= high + slack);
        }
      }
    }
  }
}

TEST_CASE("a batch of shapes gets the same bounds and points as single shapes") {
  std::mt19937 random(29);
  ShapeTable table;
  table.add(Sphere{0.7f});
  table.add(Capsule{0.3f, 1.1f});
  table.add(ConvexHull{ball_of_points(random, 32, 1.3)});
  table.add(SupportShape{std::make_shared<test::Ellipsoid>(Vec3f{0.5f, 1.0f, 2.0f})});
  table.add(Box{{0.5f, 0.1f, 2.0f}});
  table.add(TriangleMesh{ball_of_points(random, 9, 1.0), {0, 1, 2, 3, 4, 5, 6, 7, 8}});
  table.add(ConvexHull{ball_of_points(random, 8, 0.4)});
  const FixedSpace space({-100, -100, -100}, {100, 100, 100});
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<double> unit(-110, 110);
  for (const std::size_t count : {0u, 1u, 7u, 9u, 63u, 64u, 65u, 300u}) {
    CAPTURE(count);
    std::vector<Pose> poses;
    std::vector<PlacedShape> placed;
    for (std::size_t i = 0; i < count; ++i) {
      poses.push_back({{unit(random), unit(random), unit(random)},
                       normalise({normal(random), normal(random), normal(random), normal(random)})});
    }
    for (const Pose& pose : poses) placed.push_back({&pose, static_cast<ShapeNumber>(random() % table.size())});
    std::vector<Bounds> bounds(count + 1, Bounds{{1, 2, 3}, {4, 5, 6}});
    std::vector<FixedPoint> points(count + 1, FixedPoint{{1, 2, 3, 4}});
    table.bounds(placed, space, bounds.data(), points.data());
    for (std::size_t i = 0; i < count; ++i) {
      REQUIRE(bounds[i] == table.bounds(placed[i].shape, poses[i], space));
      std::uint32_t point[4] = {};
      space.point(poses[i].position, point);
      REQUIRE(std::equal(point, point + 4, points[i].at));
    }
    REQUIRE(bounds[count] == Bounds{{1, 2, 3}, {4, 5, 6}});
    REQUIRE(points[count].at[0] == 1);
  }
}

TEST_CASE("bounds of solids equal those of their float extents, bit for bit, on every instruction set") {
  std::mt19937 random(17);
  ShapeTable table;
  table.add(Sphere{0.7f});
  table.add(Box{{0.5f, 0.0005f, 2.0f}});
  table.add(Capsule{0.3f, 1.1f});
  table.add(Capsule{0.3f, 0.0f});
  for (const std::size_t count : {4u, 15u, 16u, 17u, 33u, 256u}) {
    table.add(ConvexHull{ball_of_points(random, count, 1.3)});
  }
  // The support along a row of the matrix, with the terms in the order of the kernels.
  const auto support = [&](ShapeNumber shape, const float row[3]) {
    const auto sum = [](float x, float y, float z) { return (x + y) + z; };
    const ShapeRow& is = table.row(shape);
    if (is.kind == ShapeKind::sphere) return double{is.size[0]};
    if (is.kind == ShapeKind::capsule) return double{std::abs(row[2]) * is.size[1]} + double{is.size[0]};
    if (is.kind == ShapeKind::box) {
      return double{sum(std::abs(row[0]) * is.size[0], std::abs(row[1]) * is.size[1], std::abs(row[2]) * is.size[2])};
    }
    const Hull& hull = table.hull(is.index_in_kind);
    float largest = -1e30f;
    for (std::size_t v = 0; v < hull.vertex_count(); ++v) {
      const Vec3f p = hull.vertex(v);
      largest = std::max(largest, sum(row[0] * p.x, row[1] * p.y, row[2] * p.z));
    }
    return double{largest};
  };
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<double> unit(-1, 1);
  const FixedSpace space({-40, -40, -30}, {40, 50, 40});
  test::on_every_target([&] {
    for (ShapeNumber shape = 0; shape < table.size(); ++shape) {
      CAPTURE(shape);
      for (int i = 0; i < 500; ++i) {
        // Some shapes are partly or completely outside the world, and some are not rotated.
        Pose pose{{unit(random) * 45, unit(random) * 45, unit(random) * 45}, {}};
        if (i % 8 != 0) pose.orientation = normalise({normal(random), normal(random), normal(random), normal(random)});
        const Rotation r = rotation(pose.orientation);
        const double margin = 0x1p-20 * double{table.row(shape).bounding_radius};
        double low[3], high[3];
        for (int axis = 0; axis < 3; ++axis) {
          const float back[3] = {-r.m[axis][0], -r.m[axis][1], -r.m[axis][2]};
          low[axis] = -support(shape, back) - margin;
          high[axis] = support(shape, r.m[axis]) + margin;
        }
        REQUIRE(table.bounds(shape, pose, space) == space.bounds(pose.position + Vec3d{low[0], low[1], low[2]},
                                                                 pose.position + Vec3d{high[0], high[1], high[2]}));
      }
    }
  });
}

TEST_CASE("volumes equal those of the solids") {
  ShapeTable table;
  const double pi = 3.14159265358979;
  CHECK(table.volume(table.add(Sphere{2})) == doctest::Approx(4.0 / 3 * pi * 8));
  CHECK(table.volume(table.add(Box{{1, 2, 3}})) == doctest::Approx(48));
  CHECK(table.volume(table.add(Capsule{1, 2})) == doctest::Approx(4.0 / 3 * pi + 4 * pi));
  CHECK(table.volume(table.add(ConvexHull{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}})) == doctest::Approx(1.0 / 6));
}

TEST_CASE("rows contain the data for kernels, and indices count by kind") {
  ShapeTable table;
  const std::vector<Vec3f> corner{{0, 0, 0}, {3, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  CHECK(table.add(ConvexHull{corner}) == 0);
  CHECK(table.add(Capsule{0.5f, 2}) == 1);
  CHECK(table.add(ConvexHull{corner}) == 2);
  CHECK(table.row(2).index_in_kind == 1);
  CHECK(table.row(2).bounding_radius == 3.0f);
  CHECK(table.row(1).size[0] == 0.5f);
  CHECK(table.row(1).size[1] == 2.0f);
  CHECK(table.row(1).bounding_radius == 2.5f);
  CHECK(table.hull(1).vertex_count() == 4);
}

TEST_CASE("an invalid shape is refused with its value and the range, and the table is unchanged") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  CHECK(refusal(Sphere{0}).find("sphere radius is 0") != std::string::npos);
  CHECK(refusal(Sphere{nan}).find("nan") != std::string::npos);
  CHECK(refusal(Sphere{2e6f}).find("1000000") != std::string::npos);
  CHECK(refusal(Box{{1, -1, 1}}).find("half extent y is -1") != std::string::npos);
  CHECK(refusal(Box{{1, 1, inf}}).find("half extent z is inf") != std::string::npos);
  CHECK(refusal(Capsule{1, -0.5f}).find("half height") != std::string::npos);
  CHECK(refusal(ConvexHull{{{0, 0, 0}, {1, nan, 0}, {0, 1, 0}, {0, 0, 1}}}).find("hull point 1") != std::string::npos);
  CHECK(refusal(ConvexHull{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}}).find("plane") != std::string::npos);
  CHECK(refusal(ConvexHull{{{0, 0, 0}, {1e-5f, 0, 0}, {0, 1e-5f, 0}, {0, 0, 1e-5f}}}).find("radius") !=
        std::string::npos);
  CHECK(refusal(TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 3}}).find("out of range") != std::string::npos);
  CHECK(refusal(SupportShape{}).find("no function") != std::string::npos);
  CHECK(refusal(SupportShape{std::make_shared<test::Ellipsoid>(Vec3f{1, 1, 1e-5f})}).find("1 mm") != std::string::npos);
  CHECK(refusal(Box{{0.0005f, 1, 1}}).empty());
  CHECK(refusal(Sphere{1e6f}).empty());
}

/// A ball whose support function adds shapes to the table that computes its bounds, as another thread may do.
class AddingSupport : public SupportFunction {
 public:
  Vec3f support(Vec3f direction) const override {
    if (table != nullptr) {
      for (int i = 0; i < 30; ++i) {
        const float size = 1 + static_cast<float>(i);
        table->add(Sphere{size});
        table->add(ConvexHull{{{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}}});
        table->add(TriangleMesh{{{0, 0, 0}, {size, 0, 0}, {0, size, 0}}, {{0, 1, 2}}});
        table->add(SupportShape{std::make_shared<test::Ellipsoid>(Vec3f{size, 1, 1})});
      }
    }
    return ball.support(direction);
  }
  ShapeTable* table = nullptr;
  test::Ellipsoid ball{Vec3f{1, 1, 1}};
};

TEST_CASE("a shape can be read while others are added") {
  ShapeTable table;
  const FixedSpace space({0, 0, 0}, {100, 100, 100});
  const auto adding = std::make_shared<AddingSupport>();
  const ShapeNumber ball = table.add(SupportShape{adding});
  const ShapeNumber hull = table.add(ConvexHull{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}});
  const Pose poses[2] = {{{50, 50, 50}, {}}, {{60, 50, 50}, {}}};
  const PlacedShape placed[3] = {{&poses[0], ball}, {&poses[1], hull}, {&poses[1], ball}};
  Bounds expected[3];
  table.bounds(placed, space, expected);
  const std::span<const ShapeRow> rows = table.rows();
  const ShapeRow& row = table.row(hull);
  const Hull& prepared = table.hull(row.index_in_kind);
  adding->table = &table;
  Bounds bounds[3];
  table.bounds(placed, space, bounds);
  CHECK(std::equal(bounds, bounds + 3, expected));
  CHECK(table.size() > 1000);
  CHECK(rows.size() == 2);
  CHECK(&row == &rows[hull]);
  CHECK(row.kind == ShapeKind::hull);
  CHECK(&prepared == &table.hull(row.index_in_kind));
  CHECK(table.row(hull).bounding_radius == row.bounding_radius);
}
