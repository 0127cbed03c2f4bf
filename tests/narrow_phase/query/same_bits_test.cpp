// The answers to queries have the same bits on every machine and with every compiler.
#include <bit>
#include <cstdint>
#include <memory>

#include <doctest/doctest.h>

#include "geometry/ellipsoid.hpp"
#include "geometry/shape_table.hpp"
#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/query/shape_query.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::NearestPoint;
using narrow_phase::QueryShape;
using narrow_phase::Ray;
using narrow_phase::ShapeHit;

/// Numbers that are the same everywhere: the distributions of the standard library are not.
class Fractions {
 public:
  /// A multiple of 1 / 1024 from -8 to 8.
  double next() {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return (static_cast<double>(state_ >> 50) - 8192) / 1024;
  }
  Vec3d vector() {
    const double x = next(), y = next();
    return {x, y, next()};
  }
  Quat orientation() {
    const double x = next(), y = next(), z = next();
    return geometry::normalise(
        {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z), static_cast<float>(next()) + 16.5f});
  }

 private:
  std::uint64_t state_ = 18;
};

/// FNV-1a over the bits of what is added.
class BitDigest {
 public:
  void add(std::uint64_t bits) {
    for (int i = 0; i < 8; ++i) value_ = (value_ ^ (bits >> (8 * i) & 0xff)) * 0x100000001b3u;
  }
  void add(double number) { add(std::bit_cast<std::uint64_t>(number)); }
  void add(const Vec3d& p) { add(p.x), add(p.y), add(p.z); }
  void add(const ShapeHit& hit) {
    add(hit.fraction), add(hit.normal), add(hit.point), add(std::uint64_t{hit.triangle});
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

/// One shape of each kind; that of number 4 is a mesh.
void add_shapes(geometry::ShapeTable& table, Fractions& numbers) {
  table.add(Sphere{1.25f});
  table.add(Box{{0.75f, 1.5f, 1}});
  table.add(Capsule{0.5f, 1.25f});
  ConvexHull hull;
  for (int i = 0; i < 24; ++i) hull.points.push_back(to_float(numbers.vector() * 0.25));
  table.add(hull);
  TriangleMesh mesh = box_surface({1, 1.5, 2}, 4);
  for (Vec3f& vertex : mesh.vertices) vertex.x += 0.125f * vertex.y * vertex.z;
  table.add(mesh);
  table.add(SupportShape{std::make_shared<test::Ellipsoid>(Vec3f{0.5f, 1, 1.5f})});
}

TEST_CASE("answers to queries have the same bits in every build") {
  Fractions numbers;
  geometry::ShapeTable table;
  add_shapes(table, numbers);
  const geometry::ShapeView shapes = table.view();
  BitDigest digest;
  std::size_t hits = 0;
  for (int i = 0; i < 4000; ++i) {
    const auto shape = static_cast<ShapeNumber>(i % 6);
    const Vec3d origin{1e6 * (i % 2), 0, 0};
    const Pose pose{origin + numbers.vector() * 0.25, numbers.orientation()};
    const Vec3d start = origin + numbers.vector();
    const Ray ray = Ray::along(start, (origin - start) * 2 + numbers.vector() * 0.25);
    ShapeHit hit;
    if (cast_ray(shapes, shape, pose, ray, 1, hit)) ++hits, digest.add(hit);
    NearestPoint nearest;
    REQUIRE(find_nearest(shapes, shape, pose, start, 1e9, nearest));
    digest.add(nearest.distance), digest.add(nearest.point), digest.add(std::uint64_t{nearest.triangle});
    const auto moving = static_cast<ShapeNumber>(i / 6 % 6);
    if (moving == 4) continue;
    const QueryShape query{shapes, moving, numbers.orientation()};
    if (sweep_shape(shapes, shape, pose, query, ray, 1, hit)) ++hits, digest.add(hit);
    std::uint32_t triangle = 0;
    const bool touch = narrow_phase::overlaps(shapes, shape, pose, query, start, triangle);
    digest.add(std::uint64_t{triangle} << 1 | (touch ? 1u : 0u));
  }
  CHECK(hits > 4000);
  CHECK(digest.value() == 8051494823704972552u);
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
