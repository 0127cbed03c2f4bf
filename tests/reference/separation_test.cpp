#include "reference/separation.hpp"

#include <doctest/doctest.h>

TEST_CASE("two spheres") {
  using namespace ringfence;
  reference::Shapes s;
  s.add(Sphere{1});
  Pose a, b;
  b.position = {1.5, 0, 0};
  CHECK(reference::separation(s[0], a, s[0], b).distance == doctest::Approx(-0.5));
}
