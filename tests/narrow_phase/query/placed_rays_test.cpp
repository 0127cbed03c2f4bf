// Rays on the axes of many shapes at once, against one after another.
#include "narrow_phase/query/ray/placed_rays.hpp"

#include <algorithm>
#include <memory>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "narrow_phase/query/query_world.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::LocalRay;
using narrow_phase::PlacedRays;

bool has_same_bits(const LocalRay& p, const LocalRay& q) {
  return p.origin == q.origin && p.direction == q.direction && p.foot == q.foot && p.begin == q.begin &&
         p.end == q.end && p.length == q.length && p.slack == q.slack;
}

TEST_CASE("rays that are placed together have the bits of rays placed one after another, on every target") {
  const QueryWorld world = make_queries(ShapeKind::box, ShapeKind::sphere, true, 1000, 91, {1e6, -3e5, 2e3});
  test::on_every_target([&] {
    const auto placed = std::make_unique<PlacedRays>();
    std::size_t misses = 0;
    for (std::size_t first = 0, count = 1; first < world.cases.size(); first += count) {
      count = std::min({first % PlacedRays::most + 1, world.cases.size() - first});
      const auto ray_of = [&](std::size_t i) {
        return narrow_phase::Ray::along(world.cases[first + i].start, world.cases[first + i].displacement);
      };
      const auto size_of = [](std::size_t i) { return 0.25 * static_cast<double>(i % 8); };
      for (std::size_t i = 0; i < count; ++i)
        placed->add(ray_of(i), world.target(world.cases[first + i]).pose, size_of(i));
      placed->run();
      for (std::size_t i = 0; i < count; ++i) {
        const Pose& pose = world.target(world.cases[first + i]).pose;
        const geometry::RotationD rotation = geometry::rotation_exact(pose.orientation), found = placed->rotation(i);
        const LocalRay expected(ray_of(i), pose.position, rotation, size_of(i));
        CHECK(has_same_bits(placed->ray(i), expected));
        CHECK(placed->misses(i) == expected.misses_ball(size_of(i)));
        CHECK(std::equal(&found.m[0][0], &found.m[0][0] + 9, &rotation.m[0][0]));
        CHECK(placed->pose(i).position == pose.position);
        misses += placed->misses(i) ? 1 : 0;
      }
    }
    CHECK(misses > 50);
    CHECK(misses < 950);
  });
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
