#include "queries/query_load.hpp"

#include <cmath>

#include "motion/random.hpp"

namespace ringfence::tools {
namespace {

constexpr std::uint32_t stream = 121;

/// A vector of length `ray_length` in a random direction: a random point of a ball, moved to its surface.
Vec3d random_direction(motion::Draws& draws) {
  for (;;) {
    const double x = draws.between(-1, 1), y = draws.between(-1, 1), z = draws.between(-1, 1);
    const double square = x * x + y * y + z * z;
    if (square > 1 || square < 1e-4) continue;
    const double scale = ray_length / std::sqrt(square);
    return {x * scale, y * scale, z * scale};
  }
}

double draw_between(double low, double high, motion::Draws& draws) { return low + (high - low) * double{draws.unit()}; }

}  // namespace

void make_rays(const QueryLoad& load, std::uint32_t frame, std::vector<worlds::QueryRow>& rows) {
  rows.resize(load.rays);
  for (std::uint32_t ray = 0; ray < load.rays; ++ray) {
    motion::Draws draws(load.seed, stream, ray, frame);
    worlds::QueryRow& row = rows[ray];
    row.frame = frame;
    row.query = ray;
    row.pose.position.x = draw_between(load.bounds_min.x, load.bounds_max.x, draws);
    row.pose.position.y = draw_between(load.bounds_min.y, load.bounds_max.y, draws);
    row.pose.position.z = draw_between(load.bounds_min.z, load.bounds_max.z, draws);
    row.displacement = random_direction(draws);
  }
}

}  // namespace ringfence::tools
