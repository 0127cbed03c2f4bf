#include "worlds/plaza.hpp"

#include <cmath>
#include <map>

#include <doctest/doctest.h>

#include "ringfence/error.hpp"
#include "ringfence/world.hpp"

namespace ringfence::worlds {

TEST_CASE("the objects of a square do not overlap, stand in its bounds, and leave the middle free") {
  for (const std::uint32_t objects : {1u, 40u, 3000u}) {
    CAPTURE(objects);
    const Scene scene = make_plaza({.objects = objects, .seed = objects});
    REQUIRE(scene.objects.size() == objects);
    WorldConfig config;
    config.nodes = 0;
    config.bounds_min = scene.bounds_min;
    config.bounds_max = scene.bounds_max;
    World world(config);
    for (const NamedShape& shape : scene.shapes) static_cast<void>(world.add_shape(shape.description));
    ObjectNumber number = 0;
    for (const ObjectSpec& spec : scene.objects) {
      CHECK(spec.number == ++number);
      CHECK(std::hypot(spec.pose.position.x, spec.pose.position.y) > 8);
      CHECK(std::abs(spec.pose.position.x) + 5 < scene.bounds_max.x);
      CHECK(std::abs(spec.pose.position.y) + 5 < scene.bounds_max.y);
      // Objects that do not move are tested against each other only if one of them may move.
      ObjectSpec movable = spec;
      movable.category = Category::active;
      CHECK(world.spawn(movable).status == Status::ok);
    }
    REQUIRE(world.advance() == Status::ok);
    CHECK(world.report().contacts == 0);
  }
}

TEST_CASE("a square is a function of its options, and has the stated shares of its kinds") {
  const Scene scene = make_plaza({.objects = 10'000, .seed = 7}), again = make_plaza({.objects = 10'000, .seed = 7});
  const Scene other = make_plaza({.objects = 10'000, .seed = 8});
  std::map<Category, int> counts;
  std::size_t same = 0;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    CHECK(scene.objects[i].pose == again.objects[i].pose);
    CHECK(scene.objects[i].shape.number() == again.objects[i].shape.number());
    same += scene.objects[i].pose == other.objects[i].pose ? 1 : 0;
    ++counts[scene.objects[i].category];
  }
  CHECK(same == 0);
  CHECK(counts[Category::fixed] == doctest::Approx(5000).epsilon(0.06));
  CHECK(counts[Category::non_active] == doctest::Approx(2000).epsilon(0.1));
  CHECK(counts[Category::active] == doctest::Approx(3000).epsilon(0.1));
  CHECK(make_plaza({.objects = 0}).objects.empty());
  CHECK_THROWS_AS(static_cast<void>(make_plaza({.objects = 1'000'001})), Error);
}

}  // namespace ringfence::worlds
