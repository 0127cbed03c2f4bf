#include "narrow_phase/mesh_world.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/vector.hpp"
#include "reference/separation.hpp"
#include "worlds/asteroid.hpp"

namespace ringfence::narrow_phase_test {
namespace {

constexpr int shapes_a_side = 24;

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

/// The part of a mesh above a height: no longer closed.
TriangleMesh bowl(const TriangleMesh& whole, float below) {
  TriangleMesh out{whole.vertices, {}};
  for (std::size_t i = 0; i < whole.indices.size(); i += 3) {
    float low = 1e9f;
    for (std::size_t k = 0; k < 3; ++k) low = std::min(low, whole.vertices[whole.indices[i + k]].z);
    if (low < below) out.indices.insert(out.indices.end(), &whole.indices[i], &whole.indices[i] + 3);
  }
  return out;
}

TriangleMesh soup(Draw& draw, int count, double size, double triangle) {
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vec3d p = draw.way(0, size);
    const Vec3d third = p + draw.way(0.1 * triangle, triangle);
    add_triangle(mesh, p, p + draw.way(triangle), third);
  }
  return mesh;
}

TriangleMesh needles(Draw& draw, int count, double size) {
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vec3d p = draw.way(0, 0.5 * size), along = draw.direction();
    const Vec3d off = draw.way(size * draw.logarithmic(1e-6, 1e-2));
    add_triangle(mesh, p, p + along * size, p + along * draw.uniform(0, size) + off);
  }
  return mesh;
}

/// `n`, or fewer: as many that `each` triangles times its square are no more than `most`.
int within(int n, int each, int most) {
  while (n > 1 && each * n * n > most) --n;
  return n;
}

TriangleMesh rock(std::uint64_t seed, std::uint32_t index, int n, int most) {
  return worlds::make_asteroid(seed, index, static_cast<std::uint32_t>(within(n, 20, most)));
}

TriangleMesh ordinary_mesh(Draw& draw, int most) {
  const auto index = static_cast<std::uint32_t>(draw.below(1000));
  switch (draw.below(6)) {
    case 0: {
      const double height = draw.uniform(0, 0.3), half = draw.uniform(0.6, 1.5);
      return terrain(within(2 + draw.below(8), 2, most), half, height);
    }
    case 1: {
      const int n = within(1 + draw.below(4), 12, most);
      return box_surface({draw.uniform(0.3, 1), draw.uniform(0.3, 1), draw.uniform(0.3, 1)}, n);
    }
    case 2:
      return bowl(rock(1, index, 4, most), 0.1f);
    default:
      return rock(1, index, 1 + draw.below(6), most);
  }
}

TriangleMesh nasty_mesh(Draw& draw, int most) {
  const double s = draw.logarithmic(0.05, 20);
  const auto index = static_cast<std::uint32_t>(draw.below(1000));
  switch (draw.below(9)) {
    case 0:
      return needles(draw, std::min(1 + draw.below(40), most), s);
    case 1: {
      const double triangle = s * draw.logarithmic(0.01, 1);
      return soup(draw, std::min(1 + draw.below(60), most), s, triangle);
    }
    case 2:
      return terrain(within(1 + draw.below(6), 2, most), s, 0);
    case 3: {
      TriangleMesh one;
      add_triangle(one, {0, 0, 0}, {s, 0, 0}, {0, s, 0});
      return one;
    }
    case 4: {
      const int n = within(1 + draw.below(3), 12, most);
      return box_surface({s, s * 0.5, draw.below(2) == 0 ? s : s * 0.01}, n);
    }
    case 5:
      return scaled(rock(2, index, 3, most), {s, s, s * 0.01});
    case 6:
      return scaled(rock(2, index, 3, most), {s, s * 0.02, s * 0.02});
    default:
      return scaled(rock(2, index, 2 + draw.below(4), most), {s, s, s});
  }
}

ShapeDescription shape_of(Draw& draw, ShapeKind kind, bool nasty, int most) {
  if (kind == ShapeKind::mesh) return nasty ? nasty_mesh(draw, most) : ordinary_mesh(draw, most);
  return nasty && kind != ShapeKind::hull ? draw.nasty(kind) : draw.ordinary(kind);
}

PairWorld with_shapes(Draw& draw, ShapeKind p, bool nasty, int most) {
  PairWorld world;
  for (int i = 0; i < 2 * shapes_a_side; ++i) {
    const ShapeDescription shape = shape_of(draw, i % 2 == 0 ? p : ShapeKind::mesh, nasty, most);
    world.table->add(shape);
    world.reference.add(shape);
  }
  return world;
}

ShapeNumber pick(Draw& draw, int side) { return static_cast<ShapeNumber>(2 * draw.below(shapes_a_side) + side); }

void add_pair(PairWorld& world, ShapeNumber p, const Pose& pose_p, ShapeNumber q, const Pose& pose_q) {
  const auto first = static_cast<std::uint32_t>(world.bodies.size());
  world.bodies.push_back({pose_p, p, first + 1});
  world.bodies.push_back({pose_q, q, first + 2});
  world.pairs.push_back({first, first + 1});
}

double radius(const PairWorld& world, ShapeNumber shape) { return double{world.table->row(shape).bounding_radius}; }

/// Along a direction from outside: where the two first touch, to within a rounding.
Vec3d touching(const PairWorld& world, ShapeNumber p, const Pose& pose_p, ShapeNumber q, const Quat& turn_q,
               const Vec3d& direction) {
  double low = 0, high = radius(world, p) + radius(world, q);
  for (int i = 0; i < 24; ++i) {
    const double middle = (low + high) / 2;
    const Pose pose_q{pose_p.position + direction * middle, turn_q};
    const auto gap = reference::separation(world.reference[p], pose_p, world.reference[q], pose_q, high - middle);
    (gap.distance > 0 ? high : low) = middle;
  }
  return pose_p.position + direction * low;
}

Vec3d special_place(Draw& draw, const PairWorld& world, ShapeNumber p, const Pose& pose_p, ShapeNumber q,
                    const Quat& turn_q) {
  const double reach = radius(world, p) + radius(world, q), small = std::min(radius(world, p), radius(world, q));
  const geometry::RotationD turn = geometry::rotation_double(pose_p.orientation);
  const Vec3d axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  switch (draw.below(6)) {
    case 0:
      return pose_p.position;
    case 1:
      return pose_p.position + draw.way(draw.logarithmic(1e-9, 1e-2) * small);
    case 2: {
      const double far = radius(world, p) * 0.25 * draw.below(8);
      return pose_p.position + geometry::rotate(turn, axes[draw.below(3)]) * far;
    }
    case 3: {
      const Vec3d direction = draw.below(2) == 0 ? draw.direction() : geometry::rotate(turn, axes[draw.below(3)]);
      double off = draw.below(2) == 0 ? 0 : draw.logarithmic(1e-6, 1e-2) * small;
      if (off != 0 && draw.below(2) != 0) off = -off;
      return touching(world, p, pose_p, q, turn_q, direction) + direction * off;
    }
    default:  // by the surface of the larger
      return pose_p.position + draw.way(draw.uniform(0.2, 1) * reach);
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
  Draw draw(seed);
  PairWorld world = with_shapes(draw, p, false, most);
  for (std::size_t i = 0; i < count; ++i) {
    const ShapeNumber first = pick(draw, 0), second = pick(draw, 1);
    const Pose pose{origin + draw.way(0, 100), draw.turn()};
    const double reach = radius(world, first) + radius(world, second);
    add_pair(world, first, pose, second, {pose.position + draw.way(draw.uniform(0.1, 1) * reach), draw.turn()});
  }
  return world;
}

PairWorld nasty_mesh_pairs(ShapeKind p, std::size_t count, std::uint64_t seed, const Vec3d& origin, int most) {
  Draw draw(seed);
  PairWorld world = with_shapes(draw, p, true, most);
  while (world.pairs.size() < count) {
    const ShapeNumber first = pick(draw, 0);
    const ShapeNumber second = p == ShapeKind::mesh && draw.below(6) == 0 ? first : pick(draw, 1);
    const double ratio = radius(world, first) / radius(world, second);
    if (ratio > 1000 || ratio < 0.001) continue;
    const Pose pose{origin, draw.below(2) == 0 ? Quat{} : draw.turn()};
    const Quat turn = draw.below(3) == 0 ? draw.turn() : draw.special_turn(pose.orientation);
    add_pair(world, first, pose, second, {special_place(draw, world, first, pose, second, turn), turn});
  }
  return world;
}

}  // namespace ringfence::narrow_phase_test
