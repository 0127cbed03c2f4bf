#include "worlds/paper_world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "geometry/shape_table.hpp"
#include "geometry/vector.hpp"
#include "motion/random.hpp"
#include "ringfence/error.hpp"
#include "worlds/asteroid.hpp"

namespace ringfence::worlds {
namespace {

using motion::Draws;

constexpr std::uint32_t shapes_per_kind = 64;
constexpr int hull_points = 32;
constexpr std::uint32_t mesh_frequency = 4;  // 320 triangles
constexpr int max_attempts = 64;
constexpr double sphere_volume = 4.18879020478639098;  // of radius 1
constexpr double min_spacing = 0.8;    // distance of two start positions, as a share of the sum of the radii
constexpr float share_at_goal = 0.9f;  // share of the steered objects that start at their goal, not on the way to it

enum PaperStream : std::uint32_t { box_sizes = 101, capsule_sizes, hull_sizes, shape_picks, orientations, positions };

void check(const PaperWorldOptions& options) {
  const auto require = [](bool condition, const std::string& message) {
    if (!condition) throw Error(message);
  };
  require(options.objects >= 1 && options.objects <= 10'000'000,
          fmt::format("objects: {}; expected 1 to 10000000", options.objects));
  require(options.coverage >= 1e-6 && options.coverage <= 0.6,
          fmt::format("coverage: {}; expected 0.000001 to 0.6", options.coverage));
  require(options.users <= 65'536, fmt::format("users: {}; expected at most 65536", options.users));
  require(options.users <= options.objects,
          fmt::format("users: {}; expected at most one for each of the {} objects", options.users, options.objects));
}

/// Cube root by Newton's method, because the result of std::cbrt differs between machines.
double cube_root(double value) {
  double root = std::max(1.0, value);
  for (int step = 0; step < 200; ++step) {
    const double next = (2 * root + value / (root * root)) / 3;
    if (next >= root && step > 0) break;
    root = next;
  }
  return root;
}

Vec3f random_unit_vector(Draws& draws) {
  for (;;) {
    const float x = draws.between(-1, 1), y = draws.between(-1, 1), z = draws.between(-1, 1);
    const Vec3f p{x, y, z};
    const float squared = dot(p, p);
    if (squared <= 1 && squared > 0.01f) return p * (1 / std::sqrt(squared));
  }
}

Quat random_orientation(Draws& draws) {
  for (;;) {
    const float x = draws.between(-1, 1), y = draws.between(-1, 1), z = draws.between(-1, 1), w = draws.between(-1, 1);
    const float squared = x * x + y * y + z * z + w * w;
    if (squared > 1 || squared < 0.01f) continue;
    const float inverse = 1 / std::sqrt(squared);
    return {x * inverse, y * inverse, z * inverse, w * inverse};
  }
}

ShapeDescription make_shape(ShapeKind kind, std::uint64_t seed, std::uint32_t index) {
  if (kind == ShapeKind::sphere) return Sphere{1};
  if (kind == ShapeKind::box) {
    Draws draws(seed, box_sizes, index);
    const float x = draws.between(0.6f, 1.2f), y = draws.between(0.6f, 1.2f), z = draws.between(0.6f, 1.2f);
    return Box{{x, y, z}};
  }
  if (kind == ShapeKind::capsule) {
    Draws draws(seed, capsule_sizes, index);
    const float radius = draws.between(0.4f, 0.8f), half_height = draws.between(0.3f, 1.0f);
    return Capsule{radius, half_height};
  }
  if (kind == ShapeKind::mesh) return make_asteroid(seed, index, mesh_frequency);
  Draws draws(seed, hull_sizes, index);
  const float x = draws.between(0.6f, 1.2f), y = draws.between(0.6f, 1.2f), z = draws.between(0.6f, 1.2f);
  ConvexHull hull;
  for (int i = 0; i < hull_points; ++i) {
    const Vec3f p = random_unit_vector(draws);
    hull.points.push_back({p.x * x, p.y * y, p.z * z});
  }
  return hull;
}

/// The shapes of the scene with their volumes in m³. Shapes of kind k are first[k] to first[k] + count[k] - 1.
struct ShapeLibrary {
  std::vector<NamedShape> shapes;
  std::vector<double> volumes;
  std::array<std::uint32_t, shape_kinds> first{};
  std::array<std::uint32_t, shape_kinds> count{};
};

ShapeLibrary make_library(const std::vector<ShapeKind>& cycle, std::uint64_t seed) {
  ShapeLibrary library;
  geometry::ShapeTable table;
  for (const ShapeKind kind :
       {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull, ShapeKind::mesh}) {
    if (std::find(cycle.begin(), cycle.end(), kind) == cycle.end()) continue;
    const auto k = static_cast<std::size_t>(kind);
    library.first[k] = static_cast<std::uint32_t>(library.shapes.size());
    library.count[k] = kind == ShapeKind::sphere ? 1 : shapes_per_kind;
    for (std::uint32_t i = 0; i < library.count[k]; ++i) {
      ShapeDescription shape = make_shape(kind, seed, i);
      const auto* surface = std::get_if<TriangleMesh>(&shape);
      library.volumes.push_back(surface != nullptr ? volume_inside(*surface) : table.volume(table.add(shape)));
      const std::string name = library.count[k] > 1 ? fmt::format("{}-{}", name_of(kind), i) : name_of(kind);
      library.shapes.push_back({name, std::move(shape), {}});
    }
  }
  return library;
}

std::vector<ShapeKind> kind_cycle(ShapeSetting setting) {
  using enum ShapeKind;
  switch (setting) {
    case ShapeSetting::sphere:
      return {sphere};
    case ShapeSetting::box:
      return {box};
    case ShapeSetting::capsule:
      return {capsule};
    case ShapeSetting::hull:
      return {hull};
    case ShapeSetting::mesh:
      return {mesh};
    case ShapeSetting::mixed:
      break;
  }
  return {sphere, box, hull, capsule, box, hull};
}

/// Stores the centres placed so far in a uniform grid and tests the distance of a new centre to them.
class PlacedCentres {
 public:
  PlacedCentres(double side, double largest_radius)
      : cell_(2 * min_spacing * largest_radius),
        cells_(std::clamp(static_cast<std::int64_t>(side / cell_), std::int64_t{1}, std::int64_t{256})),
        cell_size_(side / static_cast<double>(cells_)),
        heads_(static_cast<std::size_t>(cells_ * cells_ * cells_), none) {}

  /// True if `p` keeps the minimum spacing to all centres placed so far.
  bool is_free(const Vec3d& p, double radius) const {
    const std::int64_t reach = cell_size_ >= cell_ ? 1 : 2;
    const auto [x, y, z] = cell(p);
    for (std::int64_t k = std::max<std::int64_t>(0, z - reach); k <= std::min(cells_ - 1, z + reach); ++k) {
      for (std::int64_t j = std::max<std::int64_t>(0, y - reach); j <= std::min(cells_ - 1, y + reach); ++j) {
        for (std::int64_t i = std::max<std::int64_t>(0, x - reach); i <= std::min(cells_ - 1, x + reach); ++i) {
          for (std::uint32_t at = heads_[index(i, j, k)]; at != none; at = placed_[at].next) {
            const Vec3d d = placed_[at].centre - p;
            const double least = min_spacing * (placed_[at].radius + radius);
            if (dot(d, d) < least * least) return false;
          }
        }
      }
    }
    return true;
  }

  void add(const Vec3d& p, double radius) {
    const auto [x, y, z] = cell(p);
    std::uint32_t& head = heads_[index(x, y, z)];
    placed_.push_back({p, radius, head});
    head = static_cast<std::uint32_t>(placed_.size() - 1);
  }

 private:
  static constexpr std::uint32_t none = 0xffffffffu;
  struct Placed {
    Vec3d centre;
    double radius;
    std::uint32_t next;
  };

  std::array<std::int64_t, 3> cell(const Vec3d& p) const {
    const auto on_axis = [this](double v) {
      return std::clamp(static_cast<std::int64_t>(v / cell_size_), std::int64_t{0}, cells_ - 1);
    };
    return {on_axis(p.x), on_axis(p.y), on_axis(p.z)};
  }
  std::size_t index(std::int64_t x, std::int64_t y, std::int64_t z) const {
    return static_cast<std::size_t>((z * cells_ + y) * cells_ + x);
  }

  double cell_;
  std::int64_t cells_;
  double cell_size_;
  std::vector<std::uint32_t> heads_;
  std::vector<Placed> placed_;
};

Vec3f random_in_unit_ball(Draws& draws) {
  for (;;) {
    const float x = draws.between(-1, 1), y = draws.between(-1, 1), z = draws.between(-1, 1);
    if (x * x + y * y + z * z <= 1) return {x, y, z};
  }
}

/// A random start position. `share_at_goal` of the steered objects start near their goal, at a distance that grows with
/// the attempt; the others start on the way to it. An object that does not steer starts anywhere.
Vec3d start_position(const motion::Steering& steering, const ObjectSpec& object, double side, Draws& draws,
                     int attempt) {
  const double x = double{draws.unit()}, y = double{draws.unit()}, z = double{draws.unit()};
  const Vec3d random_position{side * x, side * y, side * z};
  if (object.category == Category::non_active) return random_position;
  const Vec3d goal = steering.goal_of(object.number, 0);
  if (draws.unit() < share_at_goal) {
    const double reach = double{steering.config().spread} * (1 + 3.0 * attempt / max_attempts);
    const Vec3d position = goal + to_double(random_in_unit_ball(draws)) * reach;
    return {std::clamp(position.x, 0.0, side), std::clamp(position.y, 0.0, side), std::clamp(position.z, 0.0, side)};
  }
  return random_position + (goal - random_position) * double{draws.unit()};
}

motion::SteeringConfig steering_for(const PaperWorldOptions& options, double side, double radius) {
  motion::SteeringConfig steering;
  steering.bounds_max = {side, side, side};
  steering.seed = options.seed;
  steering.targets = options.targets != 0 ? options.targets : std::max(1u, options.objects / 50);
  steering.target_interval = options.target_interval;
  steering.retarget_interval = options.retarget_interval;
  // Lengths are proportional to the mean object radius. The spread around a target is also proportional to the cube
  // root of the number of objects that share the target, so the local density is bounded for all parameters.
  const double steered = options.users + (options.objects - options.users) / 2.0;
  const double sharing = std::max(1.0, steered / steering.targets);
  steering.speed = static_cast<float>(0.3 * radius);
  steering.spread = static_cast<float>(0.5 * radius * cube_root(sharing));
  steering.slop = static_cast<float>(0.2 * radius);
  steering.push = static_cast<float>(0.25 * radius);
  return steering;
}

}  // namespace

PaperWorld make_paper_world(const PaperWorldOptions& options) {
  check(options);
  const std::vector<ShapeKind> cycle = kind_cycle(options.shapes);
  ShapeLibrary library = make_library(cycle, options.seed);

  PaperWorld world;
  std::vector<double> radii;
  double volume = 0;
  for (std::uint32_t i = 0; i < options.objects; ++i) {
    ObjectSpec object;
    object.number = i + 1;
    // Two consecutive objects have the same kind of shape, so active and non-active objects have the same mix of kinds.
    const auto kind = static_cast<std::size_t>(cycle[i / 2 % cycle.size()]);
    Draws draws(options.seed, shape_picks, object.number);
    object.shape = ShapeId(library.first[kind] + motion::uniform_below(library.count[kind], draws.word()));
    if (i < options.users) {
      object.category = Category::avatar;
      object.user = UserId(i);
    } else {
      object.category = i % 2 == 0 ? Category::active : Category::non_active;
    }
    volume += library.volumes[object.shape.number()];
    radii.push_back(cube_root(library.volumes[object.shape.number()] / sphere_volume));
    world.scene.objects.push_back(object);
  }

  const double side = cube_root(volume / options.coverage);
  world.scene.bounds_max = {side, side, side};
  world.steering = steering_for(options, side, cube_root(volume / options.objects / sphere_volume));

  const motion::Steering steering(world.steering);
  PlacedCentres placed(side, *std::max_element(radii.begin(), radii.end()));
  for (std::uint32_t i = 0; i < options.objects; ++i) {
    ObjectSpec& object = world.scene.objects[i];
    Draws turn(options.seed, orientations, object.number);
    object.pose.orientation = random_orientation(turn);
    Draws draws(options.seed, positions, object.number);
    for (int attempt = 0; attempt < max_attempts; ++attempt) {
      object.pose.position = start_position(steering, object, side, draws, attempt);
      if (placed.is_free(object.pose.position, radii[i])) break;
    }
    placed.add(object.pose.position, radii[i]);
  }
  world.scene.shapes = std::move(library.shapes);
  return world;
}

}  // namespace ringfence::worlds
