#include "queries/query_scene.hpp"

#include <cmath>
#include <numbers>
#include <random>

#include "facade/recorded_world.hpp"
#include "geometry/vector.hpp"

namespace ringfence::bench {
namespace {

constexpr std::size_t recorded_frames = 16;

/// Random numbers that are the same everywhere.
class Random {
 public:
  double uniform(double from, double to) { return from + (to - from) * static_cast<double>(engine_() >> 11) * 0x1p-53; }
  Vec3d in(const Vec3d& min, const Vec3d& max) {
    const double x = uniform(min.x, max.x), y = uniform(min.y, max.y);
    return {x, y, uniform(min.z, max.z)};
  }
  /// Of this length, in any direction.
  Vec3d along(double length) {
    for (;;) {
      const Vec3d p = in({-1, -1, -1}, {1, 1, 1});
      const double size = ringfence::length(p);
      if (size > 0.1 && size < 1) return p * (length / size);
    }
  }
  Quat orientation() {
    const Vec3d axis = along(1);
    const double half = uniform(0, std::numbers::pi), s = std::sin(half);
    return geometry::normalise({static_cast<float>(axis.x * s), static_cast<float>(axis.y * s),
                                static_cast<float>(axis.z * s), static_cast<float>(std::cos(half))});
  }
  std::size_t below(std::size_t end) { return engine_() % end; }

 private:
  std::mt19937_64 engine_{1};
};

void add_ball(QueryScene& out, float radius) {
  out.ball_radius = radius;
  out.ball = out.shapes->add(Sphere{radius});
}

void add_queries(QueryScene& out, Ask ask, std::size_t count, Random& random) {
  const worlds::Scene& scene = out.scene;
  const ShapeId ball(out.ball);
  if (ask == Ask::rays) out.rays = make_rays(scene.bounds_min, scene.bounds_max, count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d at = random.in(scene.bounds_min, scene.bounds_max);
    if (ask == Ask::sweeps) out.sweeps.push_back({ball, {at, {}}, random.along(10)});
    if (ask == Ask::overlaps) out.overlaps.push_back({ball, {at, {}}});
    if (ask == Ask::nearest) out.nearest.push_back({at, 20});
  }
}

/// A ball with dents: 48 triangles.
TriangleMesh make_rock(Random& random) {
  constexpr std::uint32_t rings = 4, columns = 6;
  TriangleMesh mesh;
  mesh.vertices.push_back({0, 0, 1});
  for (std::uint32_t i = 1; i <= rings; ++i) {
    for (std::uint32_t j = 0; j < columns; ++j) {
      const double down = std::numbers::pi * i / (rings + 1), around = 2 * std::numbers::pi * j / columns;
      const double r = random.uniform(0.7, 1.2);
      mesh.vertices.push_back({static_cast<float>(r * std::sin(down) * std::cos(around)),
                               static_cast<float>(r * std::sin(down) * std::sin(around)),
                               static_cast<float>(r * std::cos(down))});
    }
  }
  mesh.vertices.push_back({0, 0, -1});
  const auto at = [](std::uint32_t ring, std::uint32_t column) { return 1 + ring * columns + column % columns; };
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    mesh.indices.insert(mesh.indices.end(), {a, b, c});
  };
  for (std::uint32_t j = 0; j < columns; ++j) {
    add(0, at(0, j), at(0, j + 1));
    for (std::uint32_t i = 0; i + 1 < rings; ++i) {
      add(at(i, j), at(i + 1, j), at(i + 1, j + 1));
      add(at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
    add(rings * columns + 1, at(rings - 1, j + 1), at(rings - 1, j));
  }
  return mesh;
}

}  // namespace

std::vector<RayQuery> make_rays(const Vec3d& min, const Vec3d& max, std::size_t count) {
  Random random;
  std::vector<RayQuery> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d start = random.in(min, max);
    rays.push_back({start, random.along(50)});
  }
  return rays;
}

QueryScene make_moving_scene(std::uint32_t objects, Ask ask) {
  RecordedWorld recorded = record_world(worlds::ShapeSetting::mixed, objects, recorded_frames);
  let_all_move(recorded);
  QueryScene out;
  out.scene = std::move(recorded.scene);
  out.shapes = std::move(recorded.shapes);
  out.frames = std::move(recorded.frames);
  add_ball(out, ask == Ask::overlaps ? 5.0f : 0.5f);
  Random random;
  add_queries(out, ask, 10000, random);
  return out;
}

QueryScene make_static_scene() {
  constexpr std::size_t objects = 64000, boxes = objects / 10 * 9, kinds_of_box = 64, kinds_of_mesh = 8;
  Random random;
  QueryScene out;
  out.shapes = std::make_unique<geometry::ShapeTable>();
  worlds::Scene& scene = out.scene;
  scene.bounds_min = {0, 0, 0};
  scene.bounds_max = {160, 160, 160};
  const auto add_shape = [&](const ShapeDescription& shape) {
    scene.shapes.push_back({"shape" + std::to_string(scene.shapes.size()), shape, {}});
    out.shapes->add(shape);
  };
  for (std::size_t i = 0; i < kinds_of_box; ++i) {
    const Vec3d half = random.in({0.3, 0.3, 0.3}, {1.2, 1.2, 1.2});
    add_shape(Box{{static_cast<float>(half.x), static_cast<float>(half.y), static_cast<float>(half.z)}});
  }
  for (std::size_t i = 0; i < kinds_of_mesh; ++i) add_shape(make_rock(random));
  std::vector<Pose>& poses = out.frames.emplace_back();
  for (std::size_t i = 0; i < objects; ++i) {
    ObjectSpec& object = scene.objects.emplace_back();
    const std::size_t shape = i < boxes ? random.below(kinds_of_box) : kinds_of_box + random.below(kinds_of_mesh);
    object.shape = ShapeId(static_cast<ShapeNumber>(shape));
    object.category = Category::fixed;
    object.pose = {random.in(scene.bounds_min, scene.bounds_max), random.orientation()};
    poses.push_back(object.pose);
  }
  add_ball(out, 0.5f);
  add_queries(out, Ask::rays, 1000000, random);
  return out;
}

}  // namespace ringfence::bench
