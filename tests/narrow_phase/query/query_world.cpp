#include "narrow_phase/query/query_world.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "geometry/ellipsoid.hpp"
#include "narrow_phase/convex_world.hpp"
#include "narrow_phase/mesh_world.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using reference::PreparedShape;
using reference::Vector;

bool is_support(ShapeKind kind) { return kind == ShapeKind::support; }

/// Pairs of a target and a moving shape; the first of a pair is the target unless that is a mesh.
PairWorld make_pairs(ShapeKind target, ShapeKind moving, bool hard, std::size_t count, std::uint64_t seed,
                     const Vec3d& origin) {
  if (target == ShapeKind::mesh && !is_support(moving)) {
    return (hard ? degenerate_mesh_pairs : ordinary_mesh_pairs)(moving, count, seed, origin, 80);
  }
  RandomSource random(seed);
  const auto ellipsoid = [&]() -> ShapeDescription {
    const double size = hard ? random.logarithmic(0.03, 30) : 1;
    const auto radius = [&] { return static_cast<float>(size * random.uniform(0.3, 1.5)); };
    const float x = radius(), y = radius(), z = radius();
    return SupportShape{std::make_shared<test::Ellipsoid>(Vec3f{x, y, z})};
  };
  if (target == ShapeKind::mesh) {
    PairWorld world = (hard ? degenerate_mesh_pairs : ordinary_mesh_pairs)(ShapeKind::sphere, count, seed, origin, 80);
    for (geometry::CandidatePair& pair : world.pairs) {
      const Pose pose = world.bodies[pair.a].pose;
      pair.a = world.add(ellipsoid(), pose);
    }
    return world;
  }
  if (!is_support(target) && !is_support(moving)) {
    return (hard ? degenerate_convex_pairs : ordinary_convex_pairs)(target, moving, count, seed, origin);
  }
  PairWorld world;
  const auto shape = [&](ShapeKind kind) { return is_support(kind) ? ellipsoid() : random.ordinary(kind); };
  for (std::size_t i = 0; i < count; ++i) {
    const ShapeDescription a = shape(target), b = shape(moving);
    const Pose pose_a{origin + random.vector(0, 10), random.orientation()};
    const Pose pose_b{pose_a.position + random.vector(0, 3), random.orientation()};
    world.add_pair(a, pose_a, b, pose_b);
  }
  return world;
}

/// The farthest point of a shape along `n`, on its axes.
Vector support(const PreparedShape& shape, const Vector& n) {
  if (shape.kind != ShapeKind::mesh) return shape.core.support(n) + n * (shape.core.radius / length(n));
  Vector best = shape.surface.triangles[0].corners[0];
  for (const auto& t : shape.surface.triangles) {
    for (const Vector& c : t.corners) {
      if (dot(n, c) > dot(n, best)) best = c;
    }
  }
  return best;
}

/// Makes paths relative to a target's position, on the world's axes.
class PathSource {
 public:
  struct Path {
    Vector start, displacement;
  };

  PathSource(RandomSource& random, const PreparedShape& target, const Quat& of_target, const PreparedShape& moving,
             const Quat& of_moving)
      : random_(random),
        target_(target),
        moving_(moving),
        target_axes_(reference::rotation_of(of_target)),
        moving_axes_(reference::rotation_of(of_moving)) {}

  Path ordinary() {
    const double size = target_.bounding_radius + moving_.bounding_radius;
    const Vector aim(random_.vector(0, 1.2 * size));
    return through(aim, direction(), size * random_.logarithmic(0.1, 20), random_.uniform(-0.2, 1.2));
  }

  Path hard() {
    const double size = target_.bounding_radius;
    switch (random_.below(8)) {
      case 0:  // no length
        return {random_.below(2) == 0 ? feature() : Vector(random_.vector(0, size)), {}};
      case 1: {  // through two features: along edges and faces, through corners
        const Vector p = feature(), q = feature();
        const Vector between = q - p;
        if (!(length(between) > 0)) return ordinary();
        return {p - between * random_.below(3), between * (1 + random_.below(4))};
      }
      case 2:  // from inside
        return {Vector(random_.vector(0, 0.5 * size)), direction() * (size * random_.logarithmic(0.01, 10))};
      case 3: {  // along an axis of the target
        const auto part = [&] { return size * 0.25 * (random_.below(9) - 4); };
        const double p = part(), q = part();
        const Vector places[] = {{p, q, -3 * size}, {p, -3 * size, q}, {-3 * size, p, q}};
        const Vector ways[] = {{0, 0, 6 * size}, {0, 6 * size, 0}, {6 * size, 0, 0}};
        const int axis = random_.below(3);
        return {target_axes_ * places[axis], target_axes_ * ways[axis]};
      }
      case 4:  // from far away
        return through(feature(), direction(), size * random_.logarithmic(1e3, 1e5), random_.uniform(0.5, 1));
      case 5:  // short, at the surface
        return through(touching(direction()), direction(), size * random_.logarithmic(1e-9, 1e-2),
                       random_.uniform(-0.5, 1.5));
      default:
        return grazing();
    }
  }

 private:
  Vector direction() { return Vector(random_.direction()); }

  static Path through(const Vector& aim, const Vector& along, double length, double part) {
    return {aim - along * (length * part), along * length};
  }

  /// A corner, or the middle of an edge or a face; on a rounded shape any point of the surface.
  Vector feature() {
    if (target_.kind == ShapeKind::mesh) {
      const auto& triangles = target_.surface.triangles;
      const auto& c = triangles[static_cast<std::size_t>(random_.below(static_cast<int>(triangles.size())))].corners;
      const int kind = random_.below(3);
      return target_axes_ * (kind == 0 ? c[0] : kind == 1 ? (c[0] + c[1]) * 0.5 : (c[0] + c[1] + c[2]) * (1.0 / 3));
    }
    const reference::Core& core = target_.core;
    if (core.function || core.radius > 0 || core.triangles.empty()) return support_of_target(direction());
    const auto& t = core.triangles[static_cast<std::size_t>(random_.below(static_cast<int>(core.triangles.size())))];
    const Vector &p = core.vertices[t[0]], &q = core.vertices[t[1]], &r = core.vertices[t[2]];
    const int kind = random_.below(3);
    return target_axes_ * (kind == 0 ? p : kind == 1 ? (p + q) * 0.5 : (p + q + r) * (1.0 / 3));
  }

  Vector support_of_target(const Vector& n) { return target_axes_ * support(target_, target_axes_.inverse(n)); }

  /// A place of the moving shape where it touches the target from the side of `n`.
  Vector touching(const Vector& n) {
    return support_of_target(n) - moving_axes_ * support(moving_, moving_axes_.inverse(-n));
  }

  Path grazing() {
    Vector n = direction();
    if (!target_.core.normals.empty() && random_.below(2) == 0) {
      const auto& normals = target_.core.normals;
      n = target_axes_ * normals[static_cast<std::size_t>(random_.below(static_cast<int>(normals.size())))];
    }
    static constexpr double offsets[] = {0, 1e-14, 1e-12, 1e-9, 1e-6, 1e-3};
    const double off = offsets[random_.below(6)] * (random_.below(2) == 0 ? 1 : -1);
    const double small = moving_.bounding_radius > 0 ? std::min(target_.bounding_radius, moving_.bounding_radius)
                                                     : target_.bounding_radius;
    const Vector side = cross(n, direction());
    if (!(length(side) > 0.1)) return ordinary();
    const Vector along = side * (1 / length(side));
    return through(touching(n) + n * (off * small), along, target_.bounding_radius * random_.logarithmic(1, 100),
                   random_.uniform(0, 1));
  }

  RandomSource& random_;
  const PreparedShape &target_, &moving_;
  reference::Rotation target_axes_, moving_axes_;
};

Vec3d sum(const Vec3d& p, const Vector& q) { return {p.x + q.x, p.y + q.y, p.z + q.z}; }

double largest(const Vec3d& p) { return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}); }

/// What is allowed for a query, metres: relative to the smaller size, and the rounding of the coordinates. Support
/// functions return floats: their contract is 10^-5 of both sizes.
double allowed_for(const QueryWorld& world, const QueryCase& query, bool is_sweep, double relative) {
  const double of_target = world.reference_of(world.target(query)).bounding_radius;
  const double of_moving = world.reference_of(world.moving(query)).bounding_radius;
  const double coordinates = largest(world.target(query).pose.position) + largest(query.start) +
                             largest(query.displacement) + of_target + (is_sweep ? of_moving : 0);
  const auto is_support_body = [&](const narrow_phase::Body& body) {
    return is_support(world.pairs.shapes().view().row(body.shape).kind);
  };
  const double of_floats =
      is_sweep && (is_support_body(world.target(query)) || is_support_body(world.moving(query))) ? 1e-5 : 0;
  return relative * (is_sweep ? std::min(of_target, of_moving) : of_target) + of_floats * (of_target + of_moving) +
         4e-15 * coordinates;
}

void note(QueryTally& tally, std::size_t index, const std::string& error) {
  if (error.empty()) return;
  if (++tally.wrong <= 3) tally.text += "query " + std::to_string(index) + ": " + error + "\n";
}

void count(QueryTally& tally, const narrow_phase::ShapeHit* hit) {
  ++(!hit ? tally.misses : hit->fraction > 0 ? tally.hits : tally.inside);
}

template <class Query>
QueryTally check_hits(const QueryWorld& world, bool is_sweep, double relative, const Query& query_hit) {
  QueryTally tally;
  for (std::size_t i = 0; i < world.cases.size(); ++i) {
    const QueryCase& query = world.cases[i];
    const narrow_phase::Body& body = world.target(query);
    const Pose start{query.start, is_sweep ? world.moving(query).pose.orientation : Quat{}};
    narrow_phase::ShapeHit hit;
    const bool is_hit = query_hit(query, narrow_phase::Ray::along(query.start, query.displacement), hit);
    const reference::ClaimedHit claimed{hit.fraction, hit.normal, hit.point};
    const reference::Motion motion{is_sweep ? world.reference_of(world.moving(query)) : reference::point_shape(), start,
                                   query.displacement};
    count(tally, is_hit ? &hit : nullptr);
    note(tally, i,
         reference::describe_hit_error(world.reference_of(body), body.pose, motion, is_hit ? &claimed : nullptr,
                                       allowed_for(world, query, is_sweep, relative)));
  }
  return tally;
}

}  // namespace

QueryWorld make_queries(ShapeKind target, ShapeKind moving, bool hard, std::size_t count, std::uint64_t seed,
                        const Vec3d& origin) {
  QueryWorld world;
  world.pairs = make_pairs(target, moving, hard, std::min<std::size_t>(count, 60), seed, origin);
  RandomSource random(seed + 1000);
  const bool mesh_is_second = target == ShapeKind::mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const geometry::CandidatePair& pair = world.pairs.pairs[i % world.pairs.pairs.size()];
    QueryCase query{mesh_is_second ? pair.b : pair.a, mesh_is_second ? pair.a : pair.b, {}, {}};
    const narrow_phase::Body &fixed = world.target(query), &moved = world.moving(query);
    PathSource source(random, world.reference_of(fixed), fixed.pose.orientation, world.reference_of(moved),
                      moved.pose.orientation);
    const auto path = hard ? source.hard() : source.ordinary();
    query.start = sum(fixed.pose.position, path.start);
    query.displacement = path.displacement;
    world.cases.push_back(query);
  }
  return world;
}

QueryTally check_rays(const QueryWorld& world, double relative) {
  const geometry::ShapeView shapes = world.pairs.shapes().view();
  return check_hits(world, false, relative, [&](const QueryCase& query, const narrow_phase::Ray& ray, auto& hit) {
    const narrow_phase::Body& body = world.target(query);
    return cast_ray(shapes, body.shape, body.pose, ray, 1, hit);
  });
}

QueryTally check_sweeps(const QueryWorld& world, double relative) {
  const geometry::ShapeView shapes = world.pairs.shapes().view();
  return check_hits(world, true, relative, [&](const QueryCase& query, const narrow_phase::Ray& path, auto& hit) {
    const narrow_phase::Body &body = world.target(query), &moving = world.moving(query);
    const narrow_phase::QueryShape shape{shapes, moving.shape, moving.pose.orientation};
    return sweep_shape(shapes, body.shape, body.pose, shape, path, 1, hit);
  });
}

QueryTally check_overlaps(const QueryWorld& world, double relative) {
  const geometry::ShapeView shapes = world.pairs.shapes().view();
  QueryTally tally;
  for (std::size_t i = 0; i < world.cases.size(); ++i) {
    const QueryCase& query = world.cases[i];
    const narrow_phase::Body &body = world.target(query), &moving = world.moving(query);
    std::uint32_t triangle = 0;
    const bool found = narrow_phase::overlaps(shapes, body.shape, body.pose,
                                              {shapes, moving.shape, moving.pose.orientation}, query.start, triangle);
    ++(found ? tally.inside : tally.misses);
    note(tally, i,
         reference::describe_overlap_error(world.reference_of(body), body.pose, world.reference_of(moving),
                                           {query.start, moving.pose.orientation}, found,
                                           allowed_for(world, query, true, relative)));
  }
  return tally;
}

QueryTally check_nearest(const QueryWorld& world, double relative) {
  const geometry::ShapeView shapes = world.pairs.shapes().view();
  QueryTally tally;
  for (std::size_t i = 0; i < world.cases.size(); ++i) {
    const QueryCase& query = world.cases[i];
    const narrow_phase::Body& body = world.target(query);
    const double limit = reference::length(Vector(query.displacement));
    narrow_phase::NearestPoint nearest;
    const bool found = find_nearest(shapes, body.shape, body.pose, query.start, limit, nearest);
    const reference::ClaimedPoint claimed{nearest.distance, nearest.point};
    ++(!found ? tally.misses : nearest.distance > 0 ? tally.hits : tally.inside);
    note(tally, i,
         reference::describe_nearest_error(world.reference_of(body), body.pose, query.start, limit,
                                           found ? &claimed : nullptr, allowed_for(world, query, false, relative)));
  }
  return tally;
}

}  // namespace ringfence::narrow_phase_test
