#pragma once

#include <cstdint>
#include <string_view>

#include "motion/steering.hpp"
#include "worlds/scene.hpp"

namespace ringfence::worlds {

/// The shapes of the paper's world. `mixed` is 1/6 spheres, 1/6 capsules, 1/3 boxes and 1/3 convex hulls.
enum class ShapeSetting : std::uint8_t { sphere, box, capsule, hull, mixed, mesh };
constexpr const char* name_of(ShapeSetting setting) noexcept {
  constexpr const char* names[] = {"sphere", "box", "capsule", "hull", "mixed", "mesh"};
  return names[static_cast<std::size_t>(setting)];
}

/// The parameters of the experiments in section 4 of the paper. Intervals are in frames.
struct PaperWorldOptions {
  std::uint32_t objects = 4000;  ///< 1 to 10^7
  double coverage = 0.06;        ///< volume of all objects divided by the volume of the world: 10^-6 to 0.6
  std::uint32_t users = 100;     ///< users with one avatar each: 0 to `objects`, at most 65536
  ShapeSetting shapes = ShapeSetting::mixed;
  std::uint64_t seed = 1;
  std::uint32_t targets = 0;  ///< positions that objects steer to: 1 to 10^7; 0: objects / 50, at least 1
  motion::Interval target_interval{200, 800};
  motion::Interval retarget_interval{60, 400};
};

/// A scene and the parameters of the motion model that moves it.
struct PaperWorld {
  Scene scene;
  motion::SteeringConfig steering;
};

/// Generates the world of the paper's experiments: a cube whose volume follows from the coverage. Objects 1 to `users`
/// are avatars, one per user. Half of the others are active and half non-active. Orientations are random.
///
/// Sizes in metres: spheres of radius 1; boxes with half extents of 0.6 to 1.2; capsules of radius 0.4 to 0.8 and half
/// height 0.3 to 1; hulls of 32 points on a unit sphere, scaled on each axis by 0.6 to 1.2; closed meshes of 320
/// triangles from make_asteroid. There are 64 different boxes, capsules, hulls and meshes each, selected by the seed;
/// objects share them.
///
/// Steered objects start near their target or on the way to it, so that the world is crowded from the first frame. The
/// distance of two start positions is at least 0.8 of the sum of the radii (of spheres of equal volume), unless 64
/// attempts find no such position.
///
/// A pure function of the options with the same bits on every machine. Throws Error that names an option that is out of
/// range. Cost: about 1 µs per object.
PaperWorld make_paper_world(const PaperWorldOptions& options);

}  // namespace ringfence::worlds
