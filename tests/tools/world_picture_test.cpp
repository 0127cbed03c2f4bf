#include "picture/world_picture.hpp"

#include <cmath>
#include <set>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include "picture/outline.hpp"
#include "picture/palette.hpp"
#include "picture/view.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {
namespace {

/// 100 m by 100 m by 10 m: 7.2 pixels for each metre.
struct SmallWorld {
  explicit SmallWorld(std::uint32_t nodes = 1) : world(config(nodes)), ball(world.add_shape(Sphere{2})) {}

  static WorldConfig config(std::uint32_t nodes) {
    WorldConfig config;
    config.bounds_max = {100, 100, 10};
    config.nodes = nodes;
    return config;
  }
  void spawn(Category category, Vec3d position, UserId user = no_user, bool enabled = true) {
    const ObjectSpec spec{
        .shape = ball, .category = category, .enabled = enabled, .user = user, .pose = {position, {0, 0, 0, 1}}};
    REQUIRE(world.spawn(spec).status == Status::ok);
  }

  World world;
  ShapeId ball;
};

/// All circles on the map with that meaning of the fill.
std::vector<Circle> circles_on_map(const World& world, Meaning fill) {
  const Rectangle map = View(world.config().bounds_min, world.config().bounds_max).map();
  std::vector<Circle> found;
  for (const Layer& layer : draw_world(world).layers) {
    for (const Mark& mark : layer.marks) {
      const auto* circle = std::get_if<Circle>(&mark);
      if (circle != nullptr && circle->style.fill->meaning == fill && circle->centre.x < map.max.x)
        found.push_back(*circle);
    }
  }
  return found;
}

bool contains(const Polygon& polygon, Point p) {
  for (std::size_t i = 0; i < polygon.points.size(); ++i) {
    const Point &a = polygon.points[i], &b = polygon.points[(i + 1) % polygon.points.size()];
    if ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) < 0) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("each enabled object of a picture is a mark of its category at its place") {
  SmallWorld small;
  const UserId user = small.world.connect().user;
  small.spawn(Category::avatar, {10, 20, 5}, user);
  small.spawn(Category::active, {50, 50, 5});
  small.spawn(Category::non_active, {90, 80, 5});
  small.spawn(Category::fixed, {25, 75, 5});
  small.spawn(Category::active, {70, 70, 5}, no_user, false);
  REQUIRE(small.world.advance() == Status::ok);

  const auto check_mark = [&](Meaning meaning, double x, double y) {
    const auto marks = circles_on_map(small.world, meaning);
    REQUIRE(marks.size() == 1);
    const Rectangle map = View({0, 0, 0}, {100, 100, 10}).map();
    CHECK(marks[0].centre.x == doctest::Approx(map.min.x + 7.2 * x));
    CHECK(marks[0].centre.y == doctest::Approx(map.max.y - 7.2 * y));
    CHECK(marks[0].radius == doctest::Approx(2 * 7.2));
  };
  check_mark(Meaning::avatar, 10, 20);
  check_mark(Meaning::active, 50, 50);
  check_mark(Meaning::non_active, 90, 80);
  check_mark(Meaning::fixed, 25, 75);
}

TEST_CASE("each contact of a picture is marked at its point") {
  SmallWorld small;
  small.spawn(Category::active, {40, 60, 5});
  small.spawn(Category::active, {43, 60, 5});
  small.spawn(Category::active, {80, 20, 5});
  REQUIRE(small.world.advance() == Status::ok);
  const auto marks = circles_on_map(small.world, Meaning::contact);
  REQUIRE(marks.size() == 1);
  const Rectangle map = View({0, 0, 0}, {100, 100, 10}).map();
  CHECK(marks[0].centre.x == doctest::Approx(map.min.x + 7.2 * 41.5));
  CHECK(marks[0].centre.y == doctest::Approx(map.max.y - 7.2 * 60));
}

TEST_CASE("an object outside the bounds is counted in the legend and not drawn") {
  SmallWorld small;
  small.spawn(Category::active, {200, 50, 5});
  REQUIRE(small.world.advance() == Status::ok);
  CHECK(circles_on_map(small.world, Meaning::active).empty());
  const Drawing drawing = draw_world(small.world);
  bool counted = false;
  for (const Mark& mark : drawing.layers.back().marks) {
    const auto* text = std::get_if<Text>(&mark);
    counted = counted || (text != nullptr && text->text == "outside the bounds");
  }
  CHECK(counted);
}

TEST_CASE("every place of a map has the colour of a node that owns space there") {
  for (const std::uint32_t nodes : {1u, 4u, 7u}) {
    SmallWorld small(nodes);
    REQUIRE(small.world.advance() == Status::ok);
    const View view({0, 0, 0}, {100, 100, 10});
    const Drawing drawing = draw_world(small.world);
    for (double x = 0.7; x < 100; x += 5.3) {
      for (double y = 0.7; y < 100; y += 5.3) {
        std::set<int> owners;
        for (double z = 0.1; z < 10; z += 0.2)
          owners.insert(static_cast<int>(small.world.node_at({x, y, z})->number()));
        int hue = -1;
        for (const Mark& mark : drawing.layers.front().marks) {
          const auto& area = std::get<Polygon>(mark);
          if (contains(area, view({x, y, 5}))) hue = area.style.fill->hue;
        }
        CAPTURE(nodes);
        CAPTURE(x);
        CAPTURE(y);
        CHECK(owners.contains(hue));
      }
    }
  }
}

TEST_CASE("an outline is that of the shape seen from above") {
  constexpr float half_turn = 0.70710678f;  // of 90 degrees
  CHECK(outline_of(Sphere{3}, {0, 0, 0, 1}).radius == 3);
  CHECK(outline_of(Sphere{3}, {0, 0, 0, 1}).corners.empty());

  const Box box{{1, 2, 3}};
  CHECK(outline_of(box, {0, 0, 0, 1}).corners == std::vector<Point>{{-1, -2}, {1, -2}, {1, 2}, {-1, 2}});
  const Outline turned = outline_of(box, {0, half_turn, 0, half_turn});  // about y: 6 m along x, 4 m along y
  CHECK(turned.radius == doctest::Approx(std::hypot(3, 2)));
  CHECK(turned.corners.size() == 4);

  const Outline standing = outline_of(Capsule{1, 5}, {0, 0, 0, 1});
  CHECK(standing.radius == doctest::Approx(1));
  const Outline lying = outline_of(Capsule{1, 5}, {half_turn, 0, 0, half_turn});
  CHECK(lying.radius == doctest::Approx(6));

  const ConvexHull hull{{{0, 0, 0}, {4, 0, 0}, {0, 3, 0}, {1, 1, 5}}};
  CHECK(outline_of(hull, {0, 0, 0, 1}).corners == std::vector<Point>{{0, 0}, {4, 0}, {0, 3}});
}

TEST_CASE("the scale bar is 1, 2 or 5 times a power of ten, and at most a quarter of the map") {
  for (const double side : {0.3, 1.0, 7.9, 8.0, 19.99, 20.0, 100.0, 12'345.0, 3e8}) {
    const View view({0, 0, 0}, {side, side, 1});
    const double bar = view.bar_metres(), digit = bar / std::pow(10, std::floor(std::log10(bar * 1.0001)));
    CAPTURE(side);
    CHECK(bar * view.scale() <= view.width() / 4 * 1.0001);
    CHECK(bar * view.scale() >= view.width() / 10 * 0.9999);
    CHECK((digit == doctest::Approx(1) || digit == doctest::Approx(2) || digit == doctest::Approx(5)));
  }
}

TEST_CASE("text and marks can be read on light and on dark pages") {
  // Contrast of two colours: Web Content Accessibility Guidelines 2.1. 4.5 for text, 3 for marks.
  const auto luminance = [](Color color) {
    const auto linear = [](std::uint8_t channel) {
      const double c = channel / 255.0;
      return c <= 0.03928 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    };
    return 0.2126 * linear(color.red) + 0.7152 * linear(color.green) + 0.0722 * linear(color.blue);
  };
  const auto contrast = [&](Ink p, Ink q, bool dark) {
    const double a = luminance(color_of(p, dark)), b = luminance(color_of(q, dark));
    return (std::max(a, b) + 0.05) / (std::min(a, b) + 0.05);
  };
  for (const bool dark : {false, true}) {
    CAPTURE(dark);
    CHECK(contrast({Meaning::text}, {Meaning::page}, dark) >= 4.5);
    CHECK(contrast({Meaning::faint_text}, {Meaning::page}, dark) >= 4.5);
    for (std::uint8_t hue = 0; hue < node_hues; ++hue) {
      CAPTURE(int{hue});
      CHECK(contrast({Meaning::text}, {Meaning::region, hue}, dark) >= 4.5);
      CHECK(contrast({Meaning::avatar}, {Meaning::region, hue}, dark) >= 4.5);
      CHECK(contrast({Meaning::contact}, {Meaning::region, hue}, dark) >= 3);
      CHECK(contrast({Meaning::active, hue}, {Meaning::region, hue}, dark) >= 1.8);
    }
  }
}

}  // namespace ringfence::tools
