#include "narrow_phase/convex_world.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/vector.hpp"
#include "reference/separation.hpp"

namespace ringfence::narrow_phase_test {
namespace {

ConvexHull ellipsoid(RandomSource& random, int count, Vec3d radii, Vec3d centre = {}) {
  ConvexHull hull;
  for (int i = 0; i < count; ++i) {
    const Vec3d d = random.direction();
    hull.points.push_back(to_float(Vec3d{d.x * radii.x, d.y * radii.y, d.z * radii.z} + centre));
  }
  return hull;
}

ConvexHull prism(int sides, double radius, double half_height) {
  ConvexHull hull;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * 3.14159265358979323846 * i / sides;
    for (const double z : {-half_height, half_height}) {
      hull.points.push_back(to_float({radius * std::cos(angle), radius * std::sin(angle), z}));
    }
  }
  return hull;
}

ConvexHull grid(double x, double y, double z) {
  ConvexHull hull;
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      for (int k = -1; k <= 1; ++k) hull.points.push_back(to_float({i * x, j * y, k * z}));
    }
  }
  return hull;
}

ShapeDescription ordinary_shape(RandomSource& random, ShapeKind kind) {
  if (kind != ShapeKind::hull) return random.ordinary(kind);
  static constexpr int sizes[] = {4, 5, 6, 8, 12, 16, 24, 32, 32, 48, 64, 100};
  const Vec3d radii{random.uniform(0.4, 1.2), random.uniform(0.4, 1.2), random.uniform(0.4, 1.2)};
  return ellipsoid(random, sizes[random.below(12)], radii);
}

ShapeDescription degenerate_shape(RandomSource& random, ShapeKind kind) {
  if (kind != ShapeKind::hull) return random.degenerate(kind);
  const double s = random.logarithmic(0.05, 30);
  const double far = random.uniform(1, 4);
  const Vec3d away = random.vector(s * far);
  switch (random.below(9)) {
    case 0:
      return ellipsoid(random, 20, {s, s * 0.003, s * 0.003});  // needle
    case 1:
      return ellipsoid(random, 24, {s, s, std::max(5.1e-4, s * 0.001)});  // plate
    case 2: {
      const double z = random.below(2) == 0 ? s : std::max(5e-4, s * 0.002);
      return grid(s, s * (random.below(2) == 0 ? 1 : 0.5), z);
    }
    case 3: {
      const double half_height = random.below(2) == 0 ? s : s * 0.01;
      return prism(3 + random.below(30), s, half_height);
    }
    case 4:
      return ConvexHull{
          {{0, 0, 0}, {static_cast<float>(s), 0, 0}, {0, static_cast<float>(s), 0}, {0, 0, static_cast<float>(s)}}};
    case 5:
      return ellipsoid(random, 32, {s, s * 0.8, s * 0.6}, away);  // the origin is outside
    case 6:
      return ellipsoid(random, 120, {s, s, s});
    case 7:
      return grid(s, s, s);
    default:
      return ellipsoid(random, 32, {s, s * random.uniform(0.3, 1), s * random.uniform(0.3, 1)});
  }
}

/// Adds shapes of one kind, which the bodies of the world share.
std::vector<ShapeNumber> add_shapes(PairWorld& world, RandomSource& random, ShapeKind kind, int count,
                                    bool degenerate) {
  std::vector<ShapeNumber> numbers;
  for (int i = 0; i < count; ++i) {
    const ShapeDescription shape = degenerate ? degenerate_shape(random, kind) : ordinary_shape(random, kind);
    numbers.push_back(world.table->add(shape));
    world.reference.add(shape);
  }
  return numbers;
}

void add_pair(PairWorld& world, ShapeNumber p, const Pose& pose_p, ShapeNumber q, const Pose& pose_q) {
  const auto first = static_cast<std::uint32_t>(world.bodies.size());
  world.bodies.push_back({pose_p, p, first + 1});
  world.bodies.push_back({pose_q, q, first + 2});
  world.pairs.push_back({first, first + 1});
}

double radius(const PairWorld& world, ShapeNumber shape) { return double{world.table->row(shape).bounding_radius}; }

Vec3d centre_of(const PairWorld& world, ShapeNumber shape) {
  const geometry::ShapeRow& row = world.table->row(shape);
  return row.kind == ShapeKind::hull ? to_double(world.table->hull(row.index_in_kind).centroid()) : Vec3d{};
}

Vec3d turned(const Quat& q, Vec3d p) { return geometry::rotate(geometry::rotation_double(q), p); }

/// A position of q's origin that is hard for the kernels.
Vec3d special_position(RandomSource& random, const PairWorld& world, ShapeNumber p, const Pose& pose_p, ShapeNumber q,
                       const Quat& orientation_q) {
  const double sum_of_radii = radius(world, p) + radius(world, q), small = std::min(radius(world, p), radius(world, q));
  const Vec3d centred =
      pose_p.position + turned(pose_p.orientation, centre_of(world, p)) - turned(orientation_q, centre_of(world, q));
  const Vec3d axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  switch (random.below(6)) {
    case 0:
      return pose_p.position;
    case 1:
      return centred;
    case 2:
      return centred + random.vector(random.logarithmic(1e-9, 1e-2) * small);
    case 3: {  // along an axis of p, by simple fractions of its size
      const double far = radius(world, p) * 0.25 * random.below(8);
      return centred + turned(pose_p.orientation, axes[random.below(3)]) * far;
    }
    case 4:
      return centred + random.vector(random.uniform(0, 1) * sum_of_radii);
    default: {  // touching, or nearly touching
      const Vec3d direction =
          random.below(2) == 0 ? random.direction() : turned(pose_p.orientation, axes[random.below(3)]);
      double low = 0, high = 2 * sum_of_radii;
      for (int i = 0; i < 24; ++i) {
        const double middle = (low + high) / 2;
        const Pose pose_q{centred + direction * middle, orientation_q};
        (reference::separation(world.reference[p], pose_p, world.reference[q], pose_q).distance > 0 ? high : low) =
            middle;
      }
      double off = random.below(2) == 0 ? 0 : random.logarithmic(1e-6, 1e-2) * small;
      if (off != 0 && random.below(2) != 0) off = -off;
      return centred + direction * (low + off);
    }
  }
}

constexpr int shapes_per_kind = 60;

}  // namespace

PairWorld ordinary_convex_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed, const Vec3d& origin) {
  RandomSource random(seed);
  PairWorld world;
  const auto firsts = add_shapes(world, random, p, shapes_per_kind, false);
  const auto seconds = add_shapes(world, random, q, shapes_per_kind, false);
  for (std::size_t i = 0; i < count; ++i) {
    const ShapeNumber first = firsts[static_cast<std::size_t>(random.below(shapes_per_kind))];
    const ShapeNumber second = seconds[static_cast<std::size_t>(random.below(shapes_per_kind))];
    const Pose pose{origin + random.vector(0, 100), random.orientation()};
    const double sum_of_radii = radius(world, first) + radius(world, second);
    add_pair(world, first, pose, second,
             {pose.position + random.vector(std::cbrt(random.uniform(0, 1)) * sum_of_radii), random.orientation()});
  }
  return world;
}

PairWorld degenerate_convex_pairs(ShapeKind p, ShapeKind q, std::size_t count, std::uint64_t seed,
                                  const Vec3d& origin) {
  RandomSource random(seed);
  PairWorld world;
  const auto firsts = add_shapes(world, random, p, shapes_per_kind, true);
  auto seconds = add_shapes(world, random, q, shapes_per_kind, true);
  for (std::size_t i = 0; i < count; ++i) {
    const ShapeNumber first = firsts[static_cast<std::size_t>(random.below(shapes_per_kind))];
    ShapeNumber second = seconds[static_cast<std::size_t>(random.below(shapes_per_kind))];
    if (p == q && random.below(8) == 0) second = first;
    if (radius(world, first) > 1000 * radius(world, second)) second = seconds[0];
    const Pose pose{origin, random.below(2) == 0 ? Quat{} : random.orientation()};
    const Quat orientation = random.below(3) == 0 ? random.orientation() : random.special_orientation(pose.orientation);
    add_pair(world, first, pose, second,
             {special_position(random, world, first, pose, second, orientation), orientation});
  }
  return world;
}

std::vector<narrow_phase::PairContact> run_kernel(const PairWorld& world,
                                                  std::span<const geometry::CandidatePair> pairs,
                                                  narrow_phase::Kernel kernel) {
  std::vector<narrow_phase::KernelPair> sorted[2];
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const geometry::ShapeRow& a = world.table->row(world.bodies[pairs[i].a].shape);
    const geometry::ShapeRow& b = world.table->row(world.bodies[pairs[i].b].shape);
    const bool flipped = a.kind > b.kind;
    const float ratio = std::max(a.bounding_radius, b.bounding_radius) / std::min(a.bounding_radius, b.bounding_radius);
    sorted[ratio > 32].push_back({flipped ? pairs[i].b : pairs[i].a, flipped ? pairs[i].a : pairs[i].b,
                                  static_cast<std::uint32_t>(i), flipped ? narrow_phase::flip_bit : 0u});
  }
  std::vector<narrow_phase::PairContact> contacts(pairs.size() + narrow_phase::contact_slack);
  narrow_phase::PairContact* end = contacts.data();
  narrow_phase::KindCounters counters;
  for (const bool in_double : {false, true}) {
    end = kernel({world.bodies, world.table->view(), sorted[in_double], in_double}, end, counters);
  }
  contacts.resize(static_cast<std::size_t>(end - contacts.data()));
  return contacts;
}

}  // namespace ringfence::narrow_phase_test
