#include "narrow_phase/mesh_world.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/vector.hpp"
#include "reference/separation.hpp"
#include "worlds/asteroid.hpp"

namespace ringfence::narrow_phase_test {
namespace {

constexpr int shapes_per_side = 24;

void add_triangle(TriangleMesh& mesh, Vec3d p, Vec3d q, Vec3d r) {
  for (const Vec3d& v : {p, q, r}) {
    mesh.indices.push_back(static_cast<std::uint32_t>(mesh.vertices.size()));
    mesh.vertices.push_back(to_float(v));
  }
}

TriangleMesh scaled(TriangleMesh mesh, Vec3d by) {
  for (Vec3f& v : mesh.vertices) v = to_float({double{v.x} * by.x, double{v.y} * by.y, double{v.z} * by.z});
  return mesh;
}

/// The part of a mesh on one side of a height, an open surface.
TriangleMesh bowl(const TriangleMesh& whole, float below) {
  TriangleMesh out{whole.vertices, {}};
  for (std::size_t i = 0; i < whole.indices.size(); i += 3) {
    float low = 1e9f;
    for (std::size_t k = 0; k < 3; ++k) low = std::min(low, whole.vertices[whole.indices[i + k]].z);
    if (low < below) out.indices.insert(out.indices.end(), &whole.indices[i], &whole.indices[i] + 3);
  }
  return out;
}

TriangleMesh soup(RandomSource& random, int count, double size, double triangle) {
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vec3d p = random.vector(0, size);
    const Vec3d third = p + random.vector(0.1 * triangle, triangle);
    add_triangle(mesh, p, p + random.vector(triangle), third);
  }
  return mesh;
}

TriangleMesh needles(RandomSource& random, int count, double size) {
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vec3d p = random.vector(0, 0.5 * size), along = random.direction();
    const Vec3d off = random.vector(size * random.logarithmic(1e-6, 1e-2));
    add_triangle(mesh, p, p + along * size, p + along * random.uniform(0, size) + off);
  }
  return mesh;
}

/// `n` or fewer, so that `each` times its square is at most `most` triangles.
int within(int n, int each, int most) {
  while (n > 1 && each * n * n > most) --n;
  return n;
}

TriangleMesh asteroid(std::uint64_t seed, std::uint32_t index, int n, int most) {
  return worlds::make_asteroid(seed, index, static_cast<std::uint32_t>(within(n, 20, most)));
}

TriangleMesh ordinary_mesh(RandomSource& random, int most) {
  const auto index = static_cast<std::uint32_t>(random.below(1000));
  switch (random.below(6)) {
    case 0: {
      const double height = random.uniform(0, 0.3), half = random.uniform(0.6, 1.5);
      return terrain(within(2 + random.below(8), 2, most), half, height);
    }
    case 1: {
      const int n = within(1 + random.below(4), 12, most);
      return box_surface({random.uniform(0.3, 1), random.uniform(0.3, 1), random.uniform(0.3, 1)}, n);
    }
    case 2:
      return bowl(asteroid(1, index, 4, most), 0.1f);
    default:
      return asteroid(1, index, 1 + random.below(6), most);
  }
}

TriangleMesh degenerate_mesh(RandomSource& random, int most) {
  const double s = random.logarithmic(0.05, 20);
  const auto index = static_cast<std::uint32_t>(random.below(1000));
  switch (random.below(9)) {
    case 0:
      return needles(random, std::min(1 + random.below(40), most), s);
    case 1: {
      const double triangle = s * random.logarithmic(0.01, 1);
      return soup(random, std::min(1 + random.below(60), most), s, triangle);
    }
    case 2:
      return terrain(within(1 + random.below(6), 2, most), s, 0);
    case 3: {
      TriangleMesh one;
      add_triangle(one, {0, 0, 0}, {s, 0, 0}, {0, s, 0});
      return one;
    }
    case 4: {
      const int n = within(1 + random.below(3), 12, most);
      return box_surface({s, s * 0.5, random.below(2) == 0 ? s : s * 0.01}, n);
    }
    case 5:
      return scaled(asteroid(2, index, 3, most), {s, s, s * 0.01});
    case 6:
      return scaled(asteroid(2, index, 3, most), {s, s * 0.02, s * 0.02});
    default:
      return scaled(asteroid(2, index, 2 + random.below(4), most), {s, s, s});
  }
}

ShapeDescription shape_of(RandomSource& random, ShapeKind kind, bool degenerate, int most) {
  if (kind == ShapeKind::mesh) return degenerate ? degenerate_mesh(random, most) : ordinary_mesh(random, most);
  return degenerate && kind != ShapeKind::hull ? random.degenerate(kind) : random.ordinary(kind);
}

PairWorld with_shapes(RandomSource& random, ShapeKind p, bool degenerate, int most) {
  PairWorld world;
  for (int i = 0; i < 2 * shapes_per_side; ++i) {
    const ShapeDescription shape = shape_of(random, i % 2 == 0 ? p : ShapeKind::mesh, degenerate, most);
    world.table->add(shape);
    world.reference.add(shape);
  }
  return world;
}

ShapeNumber pick(RandomSource& random, int side) {
  return static_cast<ShapeNumber>(2 * random.below(shapes_per_side) + side);
}

void add_pair(PairWorld& world, ShapeNumber p, const Pose& pose_p, ShapeNumber q, const Pose& pose_q) {
  const auto first = static_cast<std::uint32_t>(world.bodies.size());
  world.bodies.push_back({pose_p, p, first + 1});
  world.bodies.push_back({pose_q, q, first + 2});
  world.pairs.push_back({first, first + 1});
}

double radius(const PairWorld& world, ShapeNumber shape) { return double{world.table->row(shape).bounding_radius}; }

/// The position along a direction from outside where the two shapes first touch, within rounding.
Vec3d touching(const PairWorld& world, ShapeNumber p, const Pose& pose_p, ShapeNumber q, const Quat& orientation_q,
               const Vec3d& direction) {
  double low = 0, high = radius(world, p) + radius(world, q);
  for (int i = 0; i < 24; ++i) {
    const double middle = (low + high) / 2;
    const Pose pose_q{pose_p.position + direction * middle, orientation_q};
    const auto gap = reference::separation(world.reference[p], pose_p, world.reference[q], pose_q, high - middle);
    (gap.distance > 0 ? high : low) = middle;
  }
  return pose_p.position + direction * low;
}

Vec3d special_position(RandomSource& random, const PairWorld& world, ShapeNumber p, const Pose& pose_p, ShapeNumber q,
                       const Quat& orientation_q) {
  const double sum_of_radii = radius(world, p) + radius(world, q), small = std::min(radius(world, p), radius(world, q));
  const geometry::RotationD rotation = geometry::rotation_double(pose_p.orientation);
  const Vec3d axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  switch (random.below(6)) {
    case 0:
      return pose_p.position;
    case 1:
      return pose_p.position + random.vector(random.logarithmic(1e-9, 1e-2) * small);
    case 2: {
      const double far = radius(world, p) * 0.25 * random.below(8);
      return pose_p.position + geometry::rotate(rotation, axes[random.below(3)]) * far;
    }
    case 3: {
      const Vec3d direction =
          random.below(2) == 0 ? random.direction() : geometry::rotate(rotation, axes[random.below(3)]);
      double off = random.below(2) == 0 ? 0 : random.logarithmic(1e-6, 1e-2) * small;
      if (off != 0 && random.below(2) != 0) off = -off;
      return touching(world, p, pose_p, q, orientation_q, direction) + direction * off;
    }
    default:  // at the surface of the larger shape
      return pose_p.position + random.vector(random.uniform(0.2, 1) * sum_of_radii);
  }
}

}  // namespace

TriangleMesh terrain(int n, double half, double height) {
  TriangleMesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const double wave = height * std::sin(1.7 * i + 0.3) * std::cos(1.3 * j);
      mesh.vertices.push_back(to_float({half * (2.0 * i / n - 1), half * (2.0 * j / n - 1), wave}));
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const auto at = static_cast<std::uint32_t>(j * (n + 1) + i), above = at + static_cast<std::uint32_t>(n) + 1;
      mesh.indices.insert(mesh.indices.end(), {at, at + 1, above, at + 1, above + 1, above});
    }
  }
  return mesh;
}

TriangleMesh box_surface(Vec3d h, int n) {
  TriangleMesh mesh;
  const double size[3] = {h.x, h.y, h.z};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const auto point = [&](int i, int j) {
        double p[3];
        p[axis] = side * size[axis];
        p[(axis + 1) % 3] = size[(axis + 1) % 3] * (2.0 * i / n - 1);
        p[(axis + 2) % 3] = size[(axis + 2) % 3] * (2.0 * j / n - 1);
        return Vec3d{p[0], p[1], p[2]};
      };
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          add_triangle(mesh, point(i, j), point(i + 1, j), point(i, j + 1));
          add_triangle(mesh, point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
        }
      }
    }
  }
  return mesh;
}

PairWorld ordinary_mesh_pairs(ShapeKind p, std::size_t count, std::uint64_t seed, const Vec3d& origin, int most) {
  RandomSource random(seed);
  PairWorld world = with_shapes(random, p, false, most);
  for (std::size_t i = 0; i < count; ++i) {
    const ShapeNumber first = pick(random, 0), second = pick(random, 1);
    const Pose pose{origin + random.vector(0, 100), random.orientation()};
    const double sum_of_radii = radius(world, first) + radius(world, second);
    add_pair(world, first, pose, second,
             {pose.position + random.vector(random.uniform(0.1, 1) * sum_of_radii), random.orientation()});
  }
  return world;
}

PairWorld degenerate_mesh_pairs(ShapeKind p, std::size_t count, std::uint64_t seed, const Vec3d& origin, int most) {
  RandomSource random(seed);
  PairWorld world = with_shapes(random, p, true, most);
  while (world.pairs.size() < count) {
    const ShapeNumber first = pick(random, 0);
    const ShapeNumber second = p == ShapeKind::mesh && random.below(6) == 0 ? first : pick(random, 1);
    const double ratio = radius(world, first) / radius(world, second);
    if (ratio > 1000 || ratio < 0.001) continue;
    const Pose pose{origin, random.below(2) == 0 ? Quat{} : random.orientation()};
    const Quat orientation = random.below(3) == 0 ? random.orientation() : random.special_orientation(pose.orientation);
    add_pair(world, first, pose, second,
             {special_position(random, world, first, pose, second, orientation), orientation});
  }
  return world;
}

}  // namespace ringfence::narrow_phase_test
