#include "broad_phase/box_worlds.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace ringfence::broad_phase::test {
namespace {

using Random = std::mt19937_64;
using Point = std::array<double, 3>;

constexpr double side = 4294967296.0;

double uniform(Random& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random() >> 11) * 0x1p-53);
}
double log_uniform(Random& random, double from, double to) {
  return std::exp(uniform(random, std::log(from), std::log(to)));
}
Point anywhere(Random& random) {
  return {uniform(random, 0, side), uniform(random, 0, side), uniform(random, 0, side)};
}

geometry::Bounds box(const Point& lower, const Point& extent) {
  geometry::Bounds b{};
  for (std::size_t a = 0; a < 3; ++a) {
    b.lower[a] = static_cast<std::uint32_t>(std::clamp(lower[a], 0.0, side - 1));
    b.upper[a] = static_cast<std::uint32_t>(std::clamp(std::floor(lower[a]) + std::floor(extent[a]), 0.0, side - 1));
  }
  return b;
}
Point cube(double extent) { return {extent, extent, extent}; }

geometry::Bounds even(Random& r) { return box(anywhere(r), cube(uniform(r, 0.06, 0.12) * side)); }
geometry::Bounds small_and_few(Random& r) { return box(anywhere(r), cube(uniform(r, 0.01, 0.02) * side)); }
geometry::Bounds all_sizes(Random& r) { return box(anywhere(r), cube(log_uniform(r, 4, side))); }
geometry::Bounds all_shapes(Random& r) {
  return box(anywhere(r), {log_uniform(r, 1, side), log_uniform(r, 1, side), log_uniform(r, 1, side)});
}
geometry::Bounds few_giants(Random& r) {
  return box(anywhere(r), cube(r() % 60 == 0 ? uniform(r, 0.3, 1) * side : uniform(r, 0.01, 0.03) * side));
}
geometry::Bounds one_spot(Random& r) {
  return box({uniform(r, 0, 4000) + side / 3, uniform(r, 0, 4000) + side / 2, uniform(r, 0, 4000)},
             cube(uniform(r, 300, 600)));
}
geometry::Bounds spot_and_strays(Random& r) { return r() % 10 == 0 ? box(anywhere(r), cube(500)) : one_spot(r); }
geometry::Bounds line_in_x(Random& r) { return box({uniform(r, 0, side), 7, side - 9}, cube(0.01 * side)); }
geometry::Bounds line_in_y(Random& r) { return box({9, uniform(r, 0, side), 12}, cube(0.01 * side)); }
geometry::Bounds line_in_z(Random& r) { return box({side / 2, side / 2, uniform(r, 0, side)}, cube(0.01 * side)); }
geometry::Bounds diagonal(Random& r) {
  const double t = uniform(r, 0, side);
  return box({t, t, t}, cube(0.01 * side));
}
geometry::Bounds plane_in_x(Random& r) { return box({5, uniform(r, 0, side), uniform(r, 0, side)}, cube(0.04 * side)); }
geometry::Bounds plane_in_z(Random& r) {
  return box({uniform(r, 0, side), uniform(r, 0, side), 3e9}, {0.04 * side, 0.04 * side, 0});
}
geometry::Bounds beyond_the_bounds(Random& r) {
  return box({uniform(r, -side, 2 * side), uniform(r, -side, 2 * side), uniform(r, -side, 2 * side)}, cube(0.1 * side));
}
geometry::Bounds flat_world_of_towers(Random& r) {  // as in air traffic: each axis scaled separately
  return box(anywhere(r), {0.03 * side, 0.03 * side, 0.3 * side});
}
geometry::Bounds points(Random& r) {
  return box({double(r() % 9) * 1e8, double(r() % 9) * 1e8, double(r() % 9) * 1e8}, cube(0));
}
geometry::Bounds plates(Random& r) {
  Point extent = cube(0.5 * side);
  extent[r() % 3] = 1000;
  return box(anywhere(r), extent);
}
geometry::Bounds rods(Random& r) {
  Point extent = cube(0.005 * side);
  extent[r() % 3] = 0.5 * side;
  return box(anywhere(r), extent);
}
geometry::Bounds touching_grid(Random& r) {  // neighbours share faces, edges and corners exactly
  constexpr double step = 1 << 28;
  return box({double(r() % 16) * step, double(r() % 16) * step, double(r() % 16) * step}, cube(step));
}
geometry::Bounds touching_rows(Random& r) {  // at the coordinates where rows and quanta of any power of two start
  const auto edge = [&] { return std::ldexp(1.0, 20 + int(r() % 12)) * double(r() % 3) - double(r() % 2); };
  return box({edge(), edge(), edge()}, cube(std::ldexp(1.0, 18 + int(r() % 6)) - double(r() % 2)));
}
geometry::Bounds all_of_it(Random& r) { return box(cube(0), r() % 2 == 0 ? cube(side) : cube(uniform(r, 0, side))); }

}  // namespace

const std::vector<BoxWorld>& box_worlds() {
  static const std::vector<BoxWorld> worlds = {
      {"even", even},
      {"small and few", small_and_few},
      {"all sizes", all_sizes},
      {"all shapes", all_shapes},
      {"few giants", few_giants},
      {"one spot", one_spot},
      {"spot and strays", spot_and_strays},
      {"line in x", line_in_x},
      {"line in y", line_in_y},
      {"line in z", line_in_z},
      {"diagonal", diagonal},
      {"plane in x", plane_in_x},
      {"plane in z", plane_in_z},
      {"beyond the bounds", beyond_the_bounds},
      {"flat world of towers", flat_world_of_towers},
      {"points", points},
      {"plates", plates},
      {"rods", rods},
      {"touching grid", touching_grid},
      {"touching rows", touching_rows},
      {"all of it", all_of_it},
  };
  return worlds;
}

std::vector<geometry::Bounds> draw_boxes(const BoxWorld& world, std::size_t count, std::mt19937_64& random) {
  std::vector<geometry::Bounds> boxes(count);
  for (auto& b : boxes) b = world.draw(random);
  return boxes;
}

}  // namespace ringfence::broad_phase::test
