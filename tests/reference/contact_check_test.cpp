#include "reference/contact_check.hpp"

#include <algorithm>
#include <optional>
#include <string>

#include <doctest/doctest.h>

#include "reference/exact_contact.hpp"
#include "reference/random_shapes.hpp"
#include "reference/separation.hpp"

using namespace ringfence;
using namespace ringfence::reference;
using reference_test::Random;

namespace {

struct PlacedPair {
  Shapes shapes;
  Pose a, b;

  std::string explain(const Contact* claimed) const { return describe_error(shapes[0], a, shapes[1], b, claimed); }
  double width() const { return band(shapes[0], shapes[1]); }
  /// The tolerance for the fields of a contact, which are floats.
  double field_width() const { return width() + 0x1p-22 * (shapes[0].bounding_radius + shapes[1].bounding_radius); }
};

PlacedPair any_pair(Random& random, bool meshes) {
  PlacedPair out;
  const double size_b = random.one_in(3) ? random.size(0.01, 100) : 1;
  out.shapes.add(meshes && random.one_in(2) ? ShapeDescription(random.mesh(1, 4)) : random.convex(1));
  out.shapes.add(meshes ? ShapeDescription(random.mesh(size_b, 3)) : random.convex(size_b));
  const double reach = out.shapes[0].bounding_radius + out.shapes[1].bounding_radius;
  out.a = {random.direction() * 1000, random.one_in(4) ? random.square_orientation() : random.orientation()};
  out.b = {Vector(out.a.position) + random.direction() * random.uniform(0, reach),
           random.one_in(4) ? random.square_orientation() : random.orientation()};
  return out;
}

void expect_wrong(const PlacedPair& pair, const Contact& claimed, const char* reason) {
  const std::string wrong = pair.explain(&claimed);
  CAPTURE(wrong);
  CHECK(wrong.find(reason) != std::string::npos);
}

}  // namespace

TEST_CASE("the reference accepts its own contacts and rejects those moved out of the band") {
  for (const bool meshes : {false, true}) {
    const std::uint64_t seed = meshes ? 32 : 31;
    CAPTURE(seed);
    Random random(seed);
    int contacts = 0, apart = 0;
    for (int i = 0; i < (meshes ? 300 : 3000); ++i) {
      CAPTURE(i);
      const PlacedPair pair = any_pair(random, meshes);
      const auto exact = exact_contact(pair.shapes[0], pair.a, pair.shapes[1], pair.b);
      const Contact* claimed = exact ? &*exact : nullptr;
      CHECK(pair.explain(claimed) == "");
      const double d = separation(pair.shapes[0], pair.a, pair.shapes[1], pair.b).distance;
      CHECK(exact.has_value() == (d <= 0));
      if (!exact) {
        ++apart;
        if (d < 2 * pair.width()) continue;
        Contact extra;
        extra.normal = {0, 0, 1};
        expect_wrong(pair, extra, "extra");
        continue;
      }
      ++contacts;
      const double out_of_band = 1.01 * pair.field_width() + 0x1p-22 * exact->depth;
      if (d < -1.01 * pair.width()) CHECK(pair.explain(nullptr).find("missing") != std::string::npos);
      Contact c = *exact;
      c.depth += static_cast<float>(out_of_band);
      expect_wrong(pair, c, "wrong depth");
      c = *exact;
      c.depth -= static_cast<float>(out_of_band);
      expect_wrong(pair, c, c.depth < 0 ? "negative" : "wrong depth");
      c = *exact;
      c.normal = {c.normal.x * 1.001f, c.normal.y * 1.001f, c.normal.z * 1.001f};
      expect_wrong(pair, c, "length");
      if (meshes) continue;  // another pair of primitives may be as deep and match
      c = *exact;
      c.point = Vector(c.point) + Vector(c.normal) * (2.01 * pair.field_width());
      expect_wrong(pair, c, "wrong point");
      c = *exact;
      c.point = Vector(c.point) + perpendicular(normalised(Vector(c.normal))) *
                                      (2.2 * (pair.shapes[0].bounding_radius + pair.shapes[1].bounding_radius));
      expect_wrong(pair, c, "wrong point");
      c = *exact;
      c.normal = {-c.normal.x, -c.normal.y, -c.normal.z};
      const auto reversed = pair.explain(&c);
      // The reversed normal is right only if b can also leave in the opposite direction by the same depth.
      const bool as_cheap = reversed.empty();
      CHECK((as_cheap || reversed.find("wrong normal") != std::string::npos || reversed.find("wrong point") == 0));
    }
    CHECK(contacts > (meshes ? 50 : 1000));
    CHECK(apart > (meshes ? 20 : 200));
  }
}

TEST_CASE("within the band both decisions are right") {
  PlacedPair pair;
  pair.shapes.add(Sphere{1});
  pair.shapes.add(Sphere{2});
  Contact touch;
  touch.normal = {1, 0, 0};
  for (const double gap : {-0.9e-4, 0.0, 0.9e-4}) {
    CAPTURE(gap);
    pair.b.position = {3 + gap, 0, 0};
    touch.point = {1 + gap / 2, 0, 0};
    CHECK(pair.explain(nullptr) == "");
    CHECK(pair.explain(&touch) == "");
  }
  pair.b.position = {3 + 1.1e-4, 0, 0};
  expect_wrong(pair, touch, "extra");
  pair.b.position = {3 - 1.1e-4, 0, 0};
  CHECK(pair.explain(nullptr).find("missing: depth 0.00011") == 0);
}

TEST_CASE("a normal that is not the least translation is wrong even if the depth is right") {
  PlacedPair pair;
  pair.shapes.add(Box{{1, 1, 1}});
  pair.shapes.add(Box{{1, 1, 1}});
  pair.b.position = {1.9, 0, 0};
  auto c = *exact_contact(pair.shapes[0], pair.a, pair.shapes[1], pair.b);
  CHECK(c.depth == doctest::Approx(0.1));
  CHECK(c.normal.x == doctest::Approx(1));
  c.normal = {0, 1, 0};
  expect_wrong(pair, c, "wrong normal: b must move 2 m along it, not 0.1");
  // Any point on the shared face is right; no point beyond it is.
  c.normal = {1, 0, 0};
  for (const double y : {-0.99, 0.0, 0.99}) {
    c.point = {0.95, y, y};
    CHECK(pair.explain(&c) == "");
  }
  c.point = {0.95, 1.2, 0};
  expect_wrong(pair, c, "wrong point");
  c.point = {0.94, 0, 0};
  expect_wrong(pair, c, "from midway");
}

TEST_CASE("far from the origin a point is right where doubles allow no better one, and wrong beyond that") {
  Random random(33);
  double farthest = 0;
  for (int i = 0; i < 1000; ++i) {
    CAPTURE(i);
    PlacedPair pair;
    pair.shapes.add(Sphere{1});
    pair.shapes.add(Sphere{1});
    const Vector far(1e15 - 8, 8 - 1e15, 0);
    pair.a.position = far + random.direction() * random.uniform(0, 4);
    pair.b.position = Vector(pair.a.position) + random.direction() * random.uniform(0.5, 1.5);
    auto c = *exact_contact(pair.shapes[0], pair.a, pair.shapes[1], pair.b);
    CHECK(pair.explain(&c) == "");
    const Vector midway = (Vector(pair.b.position) - Vector(pair.a.position)) * 0.5;
    farthest = std::max(farthest, length(Vector(c.point) - Vector(pair.a.position) - midway));
    c.point = {c.point.x + 0.5 * c.normal.x, c.point.y + 0.5 * c.normal.y, c.point.z + 0.5 * c.normal.z};
    expect_wrong(pair, c, "from midway");
  }
  CHECK(farthest > 1e-3);  // beyond the tolerance of a pair near the origin
}

TEST_CASE("values that are not numbers are reported") {
  PlacedPair pair;
  pair.shapes.add(Sphere{1});
  pair.shapes.add(Sphere{1});
  pair.b.position = {1, 0, 0};
  auto c = *exact_contact(pair.shapes[0], pair.a, pair.shapes[1], pair.b);
  c.normal.y = std::nanf("");
  expect_wrong(pair, c, "not finite");
}
