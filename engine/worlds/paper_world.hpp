#pragma once

#include <cstdint>
#include <string_view>

#include "motion/steering.hpp"
#include "worlds/scene.hpp"

namespace ringfence::worlds {

/// Which shapes the paper's world has. `mixed` is 1/6 spheres, 1/6 capsules, 1/3 boxes, 1/3 hulls.
enum class ShapeSetting : std::uint8_t { sphere, box, capsule, hull, mixed, mesh };
constexpr const char* name_of(ShapeSetting setting) noexcept {
  constexpr const char* names[] = {"sphere", "box", "capsule", "hull", "mixed", "mesh"};
  return names[static_cast<std::size_t>(setting)];
}

/// The parameters of section 4 of the paper.
struct PaperWorldOptions {
  std::uint32_t objects = 4000;  ///< 1 to 10^7
  double coverage = 0.06;        ///< volume of all objects over that of the world: 10^-6 to 0.6
  std::uint32_t users = 100;     ///< avatars, one a user: 0 to `objects`, at most 65536
  ShapeSetting shapes = ShapeSetting::mixed;
  std::uint64_t seed = 1;
  std::uint32_t targets = 0;  ///< 1 to 10^7; 0: objects / 50, at least 1
  motion::Interval target_interval{200, 800};
  motion::Interval retarget_interval{60, 400};
};

/// A scene and what moves it.
struct PaperWorld {
  Scene scene;
  motion::SteeringConfig steering;
};

/// The paper's world: a cube as large as the coverage asks, one avatar a user, of the rest half active and half
/// non-active, everything turned at random. Objects 1 to `users` are the avatars.
///
/// Sizes: spheres of radius 1; boxes with half extents of 0.6 to 1.2; capsules of radius 0.4 to 0.8 and half height
/// 0.3 to 1; hulls of 32 points on a unit sphere scaled per axis by 0.6 to 1.2; meshes as make_asteroid has them,
/// closed and of 320 triangles, whose volume is what they enclose. Of boxes, capsules, hulls and meshes there are 64
/// each, drawn by the seed, which the objects share. What steers starts about its target or on its way there, so that
/// the world is crowded from the first frame; no two centres start closer than 0.8 of the sum of their equivalent
/// radii, as far as 64 tries find such a place.
///
/// A pure function of the options, with the same bits on every machine. Throws Error naming the option that is out of
/// range. Cost: about 1 µs an object.
PaperWorld make_paper_world(const PaperWorldOptions& options);

}  // namespace ringfence::worlds
