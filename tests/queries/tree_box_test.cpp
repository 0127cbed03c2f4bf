#include "queries/tree_box.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using geometry::FixedSpace;
using geometry::Outside;
using queries::BoxConverter;
using queries::TreeBox;

/// Checks that the box of bounds from `lower` to `upper` contains them, and is at most `wider` times their distance
/// from the nearest corner of the space, or `least` metres, larger.
void check_box(const FixedSpace& space, const Vec3d& origin, const Vec3d& lower, const Vec3d& upper, double least) {
  const float margin = 0.25f;
  const TreeBox box = BoxConverter(space, origin)({space.bounds(lower, upper), margin});
  const double low[3] = {lower.x, lower.y, lower.z}, high[3] = {upper.x, upper.y, upper.z};
  const double from[3] = {origin.x, origin.y, origin.z};
  for (int a = 0; a < 3; ++a) {
    CAPTURE(a);
    CHECK(double{box.lower[a]} + from[a] <= low[a] - 0.25);
    CHECK(double{box.upper[a]} + from[a] >= high[a] + 0.25);
    // An octave has 2^19 steps, and a float 2^24.
    const double step = least + 0x1p-17 * (std::abs(low[a] - from[a]) + std::abs(high[a] - from[a]));
    CHECK(double{box.lower[a]} + from[a] >= low[a] - 0.25 - step);
    CHECK(double{box.upper[a]} + from[a] <= high[a] + 0.25 + step);
  }
}

TEST_CASE("a box contains the bounds and its margin, and little more, within a space and in its octaves") {
  Random random(1);
  for (const double size : {10.0, 1000.0, 1e6}) {
    const FixedSpace space({-size, -size, -size}, {size, size, size}, Outside::has_octaves);
    for (int i = 0; i < 3000; ++i) {
      CAPTURE(i);
      const double far = std::pow(10, random.uniform(-1, i % 3 == 0 ? 12 : -0.5)) * size;
      const Vec3d at = random.in_cube(far), more{random.uniform(0, 3), random.uniform(0, 3), random.uniform(0, 3)};
      check_box(space, random.in_cube(size / 2), at, {at.x + more.x, at.y + more.y, at.z + more.z},
                (i % 3 == 0 ? 0x1p-17 : 4e-9) * size);
    }
  }
}

TEST_CASE("bounds that saturate become infinite") {
  const FixedSpace space({0, 0, 0}, {10, 10, 10});
  const BoxConverter box_of(space, {5, 5, 5});
  const float infinity = std::numeric_limits<float>::infinity();
  const TreeBox above = box_of({space.bounds({20, 1, 1}, {30, 2, 2}), 0});
  CHECK(above.upper[0] == infinity);
  CHECK(above.lower[0] <= 5);
  CHECK(above.upper[1] < -2);
  const TreeBox across = box_of({space.bounds({-1, 4, 4}, {5, 5, 20}), 0});
  CHECK(across.lower[0] == -infinity);
  CHECK(across.upper[0] < 0.001);
  CHECK(across.upper[2] == infinity);
  check_box(space, {1, 2, 3}, {4, 4, 4}, {5, 5, 5}, 1e-6);
}

TEST_CASE("an origin is in the midst of most objects, and the space around it has small steps there") {
  Random random(2);
  std::vector<queries::FrameObject> rows(1000);
  std::vector<std::uint32_t> objects;
  for (std::uint32_t i = 0; i < rows.size(); ++i) {
    const Vec3d at = random.in_cube(100);
    rows[i].pose.position = {at.x + 5e6, at.y, at.z};
    if (i % 40 == 0) rows[i].pose.position = random.in_cube(1e15);
    objects.push_back(i);
  }
  const Vec3d origin = queries::choose_origin(rows, objects);
  CHECK(std::abs(origin.x - 5e6) <= 100);
  CHECK(std::abs(origin.y) <= 100);
  const FixedSpace space = queries::space_around(origin, rows, objects);
  for (std::uint32_t i = 0; i < rows.size(); ++i) {
    const Vec3d& at = rows[i].pose.position;
    check_box(space, origin, at, {at.x + 1, at.y + 1, at.z + 1}, 1e-4);
  }
  CHECK(queries::choose_origin(rows, {}) == Vec3d{});
}

}  // namespace
}  // namespace ringfence::queries_test
