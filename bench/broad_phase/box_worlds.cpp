#include "broad_phase/box_worlds.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <stdexcept>

namespace ringfence::bench {
namespace {

using Random = std::mt19937_64;

double uniform(Random& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random() >> 11) * 0x1p-53);
}

struct Body {
  std::array<double, 3> centre, half, velocity;
};

std::array<double, 3> anywhere(Random& random, double side) {
  return {uniform(random, 0, side), uniform(random, 0, side), uniform(random, 0, side)};
}

std::uint32_t fixed(double metres, double scale) {
  return static_cast<std::uint32_t>(std::clamp(metres * scale, 0.0, 4294967295.0)) & ~255u;
}

}  // namespace

const std::vector<std::string>& box_world_names() {
  static const std::vector<std::string> names = {"cluster", "uniform", "spot",    "line",
                                                 "sizes",   "still30", "still60", "still90"};
  return names;
}

BoxFrames make_box_world(const std::string& name, std::size_t boxes) {
  Random random(20051);
  std::normal_distribution<double> gauss;
  const double n = static_cast<double>(boxes);
  std::vector<Body> bodies(boxes);
  double volume = 0;
  for (Body& body : bodies) {
    for (int a = 0; a < 3; ++a) {
      body.half[a] = uniform(random, 0.6, 1.2);
      body.velocity[a] = uniform(random, -0.15, 0.15);
    }
    // Each decade of sizes fills the same volume on average: the probability density of the half extent r, from 5 mm to
    // 500 m, is proportional to r^-4.
    if (name == "sizes") body.half.fill(0.005 / std::cbrt(1 - uniform(random, 0, 1 - 1e-15)));
    volume += 8 * body.half[0] * body.half[1] * body.half[2];
  }
  double side = std::cbrt(volume / 0.06);
  const bool still = name.starts_with("still");
  if (name == "cluster" || still) {
    std::vector<std::array<double, 3>> targets(std::max<std::size_t>(1, boxes / 50));
    for (auto& target : targets) target = anywhere(random, side);
    // With this spread the world has about 0.5 pairs per box, like the paper's world.
    const double spread = 0.32 * side / std::cbrt(static_cast<double>(targets.size()));
    for (Body& body : bodies) {
      const auto& target = targets[random() % targets.size()];
      for (int a = 0; a < 3; ++a) body.centre[a] = target[a] + spread * gauss(random);
    }
  } else if (name == "uniform" || name == "sizes") {
    for (Body& body : bodies) body.centre = anywhere(random, side);
  } else if (name == "spot") {
    const double heap = 0.15 * side;
    side *= 1000;
    for (Body& body : bodies) {
      body.centre = anywhere(random, side);
      if (random() % 100 == 0) continue;
      for (int a = 0; a < 3; ++a) body.centre[a] = 0.4 * side + heap * gauss(random);
    }
  } else if (name == "line") {
    side = 3.6 * n;
    for (Body& body : bodies) body.centre = {0.5 * side, uniform(random, 0, side), 0.5 * side};
  } else {
    throw std::invalid_argument("unknown world " + name);
  }
  BoxFrames world;
  world.present.assign(boxes, 1);
  world.resting.assign(boxes, 0);
  if (still)
    for (std::size_t i = 0; i < boxes; ++i) world.resting[i] = random() % 100 < std::stoul(name.substr(5));
  const double scale = 4294967295.0 / side;
  for (int f = 0; f < 4; ++f) {
    // The boxes move forwards, then backwards, at times 0, 1, 2 and 1. So the sequence repeats without a jump.
    const double time = f == 3 ? 1 : f;
    std::vector<geometry::Bounds> frame(boxes);
    for (std::size_t i = 0; i < boxes; ++i) {
      const Body& body = bodies[i];
      const double t = world.resting[i] != 0 ? 0 : time;
      for (int a = 0; a < 3; ++a) {
        const double centre = body.centre[a] + t * body.velocity[a];
        frame[i].lower[a] = fixed(centre - body.half[a], scale);
        frame[i].upper[a] = fixed(centre + body.half[a], scale);
      }
    }
    world.frames.push_back(std::move(frame));
  }
  return world;
}

}  // namespace ringfence::bench
