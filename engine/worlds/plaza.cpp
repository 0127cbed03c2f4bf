#include "worlds/plaza.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "motion/random.hpp"
#include "motion/walk.hpp"
#include "ringfence/error.hpp"

namespace ringfence::worlds {
namespace {

enum PlazaStream : std::uint32_t { places = 201, kinds, turns, rocks };

constexpr std::uint32_t max_objects = 1'000'000;
constexpr double pitch = 5.5;         // metres between places: one object for each 30 square metres
constexpr double free_radius = 8;     // metres around the middle
constexpr double margin = 10;         // metres between the outermost objects and the bounds
constexpr double wall_height = 3;     // metres
constexpr double largest_radius = 2;  // metres in the plane, of any object

/// A kind of object, and how it stands.
struct Kind {
  const char* name;
  Category category;
  float height;         ///< of the shape's origin above the ground, metres
  std::uint32_t share;  ///< of 100 objects
};
constexpr std::array kind_list{
    Kind{"crate", Category::fixed, 0.75f, 20},     Kind{"wall", Category::fixed, 1.25f, 8},
    Kind{"pillar", Category::fixed, 1.5f, 10},     Kind{"rock", Category::fixed, 0.6f, 12},
    Kind{"ball", Category::non_active, 0.5f, 8},   Kind{"box", Category::non_active, 0.4f, 8},
    Kind{"barrel", Category::non_active, 0.6f, 4}, Kind{"figure", Category::active, 0.9f, 20},
    Kind{"runner", Category::active, 0.5f, 10},
};

/// Twelve points around a flat ellipsoid.
ConvexHull make_rock(std::uint64_t seed) {
  motion::Draws draws(seed, rocks, 1);
  ConvexHull hull;
  constexpr std::uint32_t corners = 6;
  for (std::uint32_t layer = 0; layer < 2; ++layer) {
    for (std::uint32_t corner = 0; corner < corners; ++corner) {
      const std::uint32_t heading = (2 * corner + layer) * 65536 / (2 * corners);
      const Quat half = motion::rotation_of(static_cast<std::uint16_t>(heading));
      const float radius = (layer == 0 ? 1.2f : 0.7f) * draws.between(0.8f, 1.1f);
      hull.points.push_back({radius * (1 - 2 * half.z * half.z), radius * 2 * half.z * half.w,
                             layer == 0 ? -0.6f : draws.between(0.3f, 0.7f)});
    }
  }
  return hull;
}

std::vector<NamedShape> make_shapes(std::uint64_t seed) {
  return {{"crate", Box{{0.75f, 0.75f, 0.75f}}, {}},
          {"wall", Box{{1.9f, 0.2f, 1.25f}}, {}},
          {"pillar", Capsule{0.4f, 1.1f}, {}},
          {"rock", make_rock(seed), {}},
          {"ball", Sphere{0.5f}, {}},
          {"box", Box{{0.4f, 0.4f, 0.4f}}, {}},
          {"barrel", Capsule{0.35f, 0.25f}, {}},
          {"figure", Capsule{0.35f, 0.55f}, {}},
          {"runner", Sphere{0.5f}, {}},
          {"avatar", Capsule{0.35f, 0.55f}, {}}};
}

std::size_t draw_kind(motion::Draws& draws) {
  std::uint32_t left = motion::uniform_below(100, draws.word());
  for (std::size_t kind = 0; kind < kind_list.size(); ++kind) {
    if (left < kind_list[kind].share) return kind;
    left -= kind_list[kind].share;
  }
  return kind_list.size() - 1;
}

/// The objects are on a square grid in random order, each moved by as much as keeps it apart from the next.
std::vector<Vec3d> make_places(const PlazaOptions& options) {
  const auto is_free = [](double x, double y) {
    const double apart = free_radius + largest_radius;
    return x * x + y * y < apart * apart;
  };
  std::vector<Vec3d> all;
  for (std::uint32_t side = 1; all.size() < options.objects; side += 2) {
    all.clear();
    const int half = static_cast<int>(side / 2);
    for (int row = -half; row <= half; ++row) {
      for (int column = -half; column <= half; ++column) {
        if (!is_free(column * pitch, row * pitch)) all.push_back({column * pitch, row * pitch, 0});
      }
    }
  }
  motion::Draws draws(options.seed, places, 0);
  for (std::size_t i = all.size(); i > 1; --i) {
    std::swap(all[i - 1], all[motion::uniform_below(static_cast<std::uint32_t>(i), draws.word())]);
  }
  all.resize(options.objects);
  constexpr auto shift = static_cast<float>(pitch / 2 - largest_radius);
  for (Vec3d& place : all) {
    place.x += static_cast<double>(draws.between(-shift, shift));
    place.y += static_cast<double>(draws.between(-shift, shift));
  }
  return all;
}

}  // namespace

Scene make_plaza(const PlazaOptions& options) {
  if (options.objects > max_objects) {
    throw Error("objects: found " + std::to_string(options.objects) + "; expected at most 1000000");
  }
  Scene scene;
  scene.shapes = make_shapes(options.seed);
  double reach = free_radius;
  ObjectNumber number = 0;
  for (const Vec3d& place : make_places(options)) {
    ObjectSpec spec;
    spec.number = ++number;
    motion::Draws draws(options.seed, kinds, number);
    const std::size_t kind = draw_kind(draws);
    spec.shape = ShapeId(static_cast<std::uint32_t>(kind));
    spec.category = kind_list[kind].category;
    spec.pose.position = {place.x, place.y, static_cast<double>(kind_list[kind].height)};
    spec.pose.orientation = motion::rotation_of(static_cast<std::uint16_t>(draws.word()));
    reach = std::max({reach, std::abs(place.x), std::abs(place.y)});
    scene.objects.push_back(spec);
  }
  reach += margin;
  scene.bounds_min = {-reach, -reach, 0};
  scene.bounds_max = {reach, reach, wall_height};
  return scene;
}

}  // namespace ringfence::worlds
