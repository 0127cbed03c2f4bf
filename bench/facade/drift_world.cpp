#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "facade/recorded_world.hpp"

namespace ringfence::bench {
namespace {

constexpr std::uint32_t shape_count = 256;
constexpr double coverage = 0.06, frame_seconds = 1.0 / 30;

/// How one object moves: on a straight line between walls that reflect it, with a constant spin.
struct Flight {
  Vec3d start, velocity, axis;
  double spin = 0;  ///< radians per second
};

class Generator {
 public:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  double normal(double deviation) { return std::normal_distribution<double>(0, deviation)(random_); }
  /// Small values are as frequent as large ones.
  float size(double low, double high) { return static_cast<float>(std::exp(uniform(std::log(low), std::log(high)))); }
  Vec3d direction() {
    const double z = uniform(-1, 1), angle = uniform(0, 2 * std::numbers::pi), r = std::sqrt(1 - z * z);
    return {r * std::cos(angle), r * std::sin(angle), z};
  }

 private:
  std::mt19937_64 random_{7};
};

/// A shape, and its volume in cubic metres; that of a hull is about two thirds of its ellipsoid's.
std::pair<ShapeDescription, double> random_shape(Generator& from) {
  const double kind = from.uniform(0, 1);
  if (kind < 0.15) {
    const float radius = from.size(0.2, 2);
    return {Sphere{radius}, 4.2 * std::pow(double{radius}, 3)};
  }
  if (kind < 0.35) {
    const float radius = from.size(0.15, 0.6), half = from.size(0.2, 2.5);
    return {Capsule{radius, half}, double{radius * radius} * (6.3 * double{half} + 4.2 * double{radius})};
  }
  const Vec3f size{from.size(0.2, 2), from.size(0.2, 2), from.size(0.2, 2)};
  const double box = 8.0 * double{size.x} * double{size.y} * double{size.z};
  if (kind < 0.65) return {Box{size}, box};
  ConvexHull hull;
  for (int points = static_cast<int>(from.size(8, 64)); points > 0; --points) {
    const Vec3d at = from.direction();
    hull.points.push_back(
        {size.x * static_cast<float>(at.x), size.y * static_cast<float>(at.y), size.z * static_cast<float>(at.z)});
  }
  return {hull, 0.35 * box};
}

double reflected(double position, double side) {
  const double in_period = std::fmod(std::fmod(position, 2 * side) + 2 * side, 2 * side);
  return in_period <= side ? in_period : 2 * side - in_period;
}

Pose pose_at(const Flight& flight, const Vec3d& sides, double seconds) {
  const double half = flight.spin * seconds / 2, s = std::sin(half);
  const Vec3d &p = flight.start, &v = flight.velocity;
  return {{reflected(p.x + v.x * seconds, sides.x), reflected(p.y + v.y * seconds, sides.y),
           reflected(p.z + v.z * seconds, sides.z)},
          {static_cast<float>(flight.axis.x * s), static_cast<float>(flight.axis.y * s),
           static_cast<float>(flight.axis.z * s), static_cast<float>(std::cos(half))}};
}

/// Half of the objects are in crowds around some places; a tenth rests, a twentieth is ten times as fast as the others.
std::vector<Flight> random_flights(Generator& from, std::size_t objects, const Vec3d& sides) {
  std::vector<Vec3d> places(1 + objects / 500);
  for (Vec3d& place : places) place = {from.uniform(0, sides.x), from.uniform(0, sides.y), from.uniform(0, sides.z)};
  std::vector<Flight> flights(objects);
  for (std::size_t i = 0; i < objects; ++i) {
    Flight& flight = flights[i];
    flight.start = {from.uniform(0, sides.x), from.uniform(0, sides.y), from.uniform(0, sides.z)};
    if (i % 2 == 0) {
      const Vec3d& place = places[i / 2 % places.size()];
      flight.start = {place.x + from.normal(12), place.y + from.normal(12), place.z + from.normal(4)};
    }
    flight.axis = from.direction();
    const double kind = from.uniform(0, 1), speed = kind < 0.1 ? 0 : kind < 0.95 ? 3 : 30;
    flight.velocity = {from.normal(speed), from.normal(speed), from.normal(speed)};
    flight.spin = kind < 0.1 ? 0 : from.uniform(0, 3);
  }
  return flights;
}

}  // namespace

RecordedWorld make_drift_world(std::uint32_t objects, std::size_t frames) {
  Generator from;
  RecordedWorld world;
  world.shapes = std::make_unique<geometry::ShapeTable>();
  double volume = 0;
  for (std::uint32_t shape = 0; shape < shape_count; ++shape) {
    auto [description, of_one] = random_shape(from);
    volume += of_one * objects / shape_count;
    world.shapes->add(description);
    world.scene.shapes.push_back({"shape" + std::to_string(shape), std::move(description), {}});
  }
  // A flat world: eight times as wide as high.
  const double height = std::cbrt(volume / coverage / 64);
  const Vec3d sides{8 * height, 8 * height, height};
  world.scene.bounds_max = sides;
  world.space = geometry::FixedSpace(world.scene.bounds_min, world.scene.bounds_max);
  const std::vector<Flight> flights = random_flights(from, objects, sides);
  world.frames.resize(frames);
  for (std::size_t k = 0; k < frames; ++k) {
    for (const Flight& flight : flights) {
      world.frames[k].push_back(pose_at(flight, sides, static_cast<double>(k) * frame_seconds));
    }
  }
  for (std::uint32_t i = 0; i < objects; ++i) {
    ObjectSpec& object = world.scene.objects.emplace_back();
    object.number = i + 1;
    object.shape = ShapeId(static_cast<ShapeNumber>(from.uniform(0, shape_count)));
    object.category = Category::active;
    object.pose = world.frames[0][i];
  }
  return world;
}

}  // namespace ringfence::bench
