#include "narrow_phase/crowd.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <variant>

#include "geometry/vector.hpp"
#include "worlds/asteroid.hpp"

namespace ringfence::narrow_phase_bench {
namespace {

/// Only a few large meshes, otherwise the preparation takes longer than the measurement.
int shapes_of(const Side& side) { return side.triangles() < 1000 ? 64 : side.triangles() < 10'000 ? 16 : 4; }
constexpr double coverage = 0.06;

using Random = std::mt19937_64;

float uniform(Random& random, double low, double high) {
  return static_cast<float>(std::uniform_real_distribution<double>(low, high)(random));
}

Vec3f direction(Random& random) {
  for (;;) {
    const Vec3f v{uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1)};
    const float length = std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
    if (length > 0.1f && length < 1) return {v.x / length, v.y / length, v.z / length};
  }
}

Quat turn(Random& random) {
  std::normal_distribution<float> normal;
  const Quat q{normal(random), normal(random), normal(random), normal(random)};
  const float length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  return {q.x / length, q.y / length, q.z / length, q.w / length};
}

ShapeDescription draw_shape(const Side& side, Random& random) {
  switch (side.kind) {
    case ShapeKind::sphere:
      return Sphere{1};
    case ShapeKind::box:
      return Box{{uniform(random, 0.6, 1.2), uniform(random, 0.6, 1.2), uniform(random, 0.6, 1.2)}};
    case ShapeKind::capsule:
      return Capsule{uniform(random, 0.4, 0.8), uniform(random, 0.3, 1)};
    case ShapeKind::mesh:
      return worlds::make_asteroid(1, static_cast<std::uint32_t>(random()), static_cast<std::uint32_t>(side.vertices));
    default: {
      const Vec3f scale{uniform(random, 0.6, 1.2), uniform(random, 0.6, 1.2), uniform(random, 0.6, 1.2)};
      ConvexHull hull;
      for (int i = 0; i < side.vertices; ++i) {
        const Vec3f p = direction(random);
        hull.points.push_back({p.x * scale.x, p.y * scale.y, p.z * scale.z});
      }
      return hull;
    }
  }
}

/// All pairs of one object of each side whose bounds overlap, in the order of a sweep along x.
std::vector<geometry::CandidatePair> candidates_of(const Crowd& crowd, const std::vector<narrow_phase::Body>& bodies) {
  constexpr double far = 1000;
  const bool same = crowd.a.name() == crowd.b.name();
  const geometry::FixedSpace space({-far, -far, -far}, {far, far, far});
  std::vector<geometry::Bounds> bounds;
  for (const narrow_phase::Body& body : bodies) bounds.push_back(crowd.shapes->bounds(body.shape, body.pose, space));
  std::vector<std::uint32_t> order(bodies.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t p, std::uint32_t q) { return bounds[p].lower[0] < bounds[q].lower[0]; });
  std::vector<geometry::CandidatePair> pairs;
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t j = i + 1; j < order.size() && bounds[order[j]].lower[0] <= bounds[order[i]].upper[0]; ++j) {
      const auto [low, high] = std::minmax(order[i], order[j]);
      if (!same && low % 2 == high % 2) continue;
      if (geometry::touch(bounds[low], bounds[high])) pairs.push_back({low, high});
    }
  }
  return pairs;
}

}  // namespace

std::string Side::name() const {
  if (lies) return "crate";
  if (kind == ShapeKind::hull) return "hull" + std::to_string(vertices);
  if (kind == ShapeKind::mesh && triangles() != 320) return "mesh" + std::to_string(triangles());
  return name_of(kind);
}

Crowd make_crowd(const Side& a, const Side& b, std::size_t objects, std::uint64_t seed) {
  Random random(seed);
  Crowd crowd{a, b, std::make_unique<geometry::ShapeTable>(), {}, {}};
  const int shapes_per_side = std::min(shapes_of(a), shapes_of(b));
  std::vector<double> volumes;
  for (int i = 0; i < 2 * shapes_per_side; ++i) {
    const ShapeDescription shape = draw_shape(i % 2 == 0 ? a : b, random);
    const ShapeNumber number = crowd.shapes->add(shape);
    const auto* surface = std::get_if<TriangleMesh>(&shape);
    volumes.push_back(surface != nullptr ? worlds::volume_inside(*surface) : crowd.shapes->volume(number));
  }
  double volume = 0;
  for (std::size_t i = 0; i < objects; ++i) {
    const auto side = static_cast<ShapeNumber>(i % 2);
    const auto shape = static_cast<ShapeNumber>(random() % static_cast<std::uint64_t>(shapes_per_side) * 2 + side);
    volume += volumes[shape];
    crowd.bodies.push_back({{}, shape, static_cast<ObjectNumber>(i + 1)});
  }
  const double width = std::cbrt(volume / coverage);
  std::uniform_real_distribution<double> place(0, width);
  for (narrow_phase::Body& body : crowd.bodies) {
    body.pose = {{place(random), place(random), place(random)}, turn(random)};
  }

  crowd.pairs = candidates_of(crowd, crowd.bodies);
  return crowd;
}

Crowd make_crates(const Side& side, std::size_t pairs, std::uint64_t seed) {
  Random random(seed);
  Crowd crowd{side, side, std::make_unique<geometry::ShapeTable>(), {}, {}};
  std::vector<float> heights;
  for (int i = 0; i < shapes_of(side); ++i) {
    const Vec3f half{uniform(random, 0.6, 1.2), uniform(random, 0.6, 1.2), uniform(random, 0.6, 1.2)};
    ConvexHull hull;
    for (int corner = 0; corner < 8; ++corner) {
      hull.points.push_back({(corner & 1) != 0 ? half.x : -half.x, (corner & 2) != 0 ? half.y : -half.y,
                             (corner & 4) != 0 ? half.z : -half.z});
    }
    crowd.shapes->add(hull);
    heights.push_back(half.z);
  }
  const auto draw = [&] { return static_cast<ShapeNumber>(random() % heights.size()); };
  for (std::uint32_t i = 0; i < pairs; ++i) {
    const ShapeNumber lower = draw(), upper = draw();
    const float angle = uniform(random, 0, 3), height = heights[lower] + heights[upper] - uniform(random, 0.001, 0.02);
    const Vec3d place{10.0 * i, 0, 0};
    const Vec3d above{uniform(random, -0.5, 0.5), uniform(random, -0.5, 0.5), height};
    crowd.bodies.push_back({{place, {0, 0, 0, 1}}, lower, 2 * i + 1});
    crowd.bodies.push_back({{place + above, {0, 0, std::sin(angle), std::cos(angle)}}, upper, 2 * i + 2});
    crowd.pairs.push_back({2 * i, 2 * i + 1});
  }
  return crowd;
}

std::vector<Frame> make_frames(const Crowd& crowd, std::size_t count, std::uint64_t seed) {
  Random random(seed);
  std::vector<Vec3d> steps;
  std::vector<Vec3f> spins;
  for (std::size_t i = 0; i < crowd.bodies.size(); ++i) {
    steps.push_back(to_double(direction(random) * uniform(random, 0, 0.3)));
    spins.push_back(direction(random) * 0.01f);  // half the angle
  }
  std::vector<Frame> frames;
  std::vector<narrow_phase::Body> bodies = crowd.bodies;
  for (std::size_t frame = 0; frame < count; ++frame) {
    frames.push_back({bodies, candidates_of(crowd, bodies)});
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      Pose& pose = bodies[i].pose;
      pose.position = pose.position + steps[i];
      const Quat q = pose.orientation;
      const Vec3f s = spins[i];
      pose.orientation =
          geometry::normalise({q.x + s.x * q.w + s.y * q.z - s.z * q.y, q.y + s.y * q.w + s.z * q.x - s.x * q.z,
                               q.z + s.z * q.w + s.x * q.y - s.y * q.x, q.w - s.x * q.x - s.y * q.y - s.z * q.z});
    }
  }
  return frames;
}

}  // namespace ringfence::narrow_phase_bench
