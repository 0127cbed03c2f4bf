#include "nodes/exchange/server/sensed_regions.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::nodes {

TEST_CASE("a node receives every object whose ball is within the distance of an object that it hosts, at any scale") {
  std::mt19937 random(3);
  std::size_t near = 0, left_out = 0;
  for (int run = 0; run < 400; ++run) {
    CAPTURE(run);
    const double scale = std::pow(10.0, static_cast<int>(random() % 16)), centre = run % 2 == 0 ? 0 : 100 * scale;
    const auto position = [&](double size) {
      const auto along = [&] { return centre + size * (static_cast<double>(random() % 2001) / 1000 - 1); };
      return Vec3d{along(), along(), along()};
    };
    SensedRegions regions;
    regions.start(3);
    std::vector<Vec3d> hosted;
    for (int i = 0; i < 5; ++i) regions.add(1, hosted.emplace_back(position(scale)));
    CHECK(regions.any(1));
    CHECK(!regions.any(0));
    for (int i = 0; i < 50; ++i) {
      const Vec3d at = position(3 * scale);
      const double radius = 0.1 * scale, distance = 0.4 * scale;
      const bool is_near = std::any_of(hosted.begin(), hosted.end(), [&](const Vec3d& host) {
        return std::hypot(at.x - host.x, at.y - host.y, at.z - host.z) <= radius + distance;
      });
      if (is_near) CHECK(regions.reaches(1, at, radius, distance));
      CHECK(!regions.reaches(0, at, radius, distance));
      near += is_near ? 1 : 0;
      left_out += regions.reaches(1, at, radius, distance) ? 0 : 1;
    }
    regions.start(3);
    CHECK(!regions.any(1));
  }
  CHECK(near > 200);
  CHECK(left_out > 2000);
}

}  // namespace ringfence::nodes
