#include "worlds/paper_world.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <set>
#include <string>

#include <doctest/doctest.h>

#include "geometry/shape_table.hpp"
#include "reference/exact_contact.hpp"
#include "ringfence/error.hpp"

namespace ringfence::worlds {
namespace {

constexpr ShapeSetting settings[] = {ShapeSetting::sphere, ShapeSetting::box, ShapeSetting::capsule, ShapeSetting::hull,
                                     ShapeSetting::mixed};

double volume_of(const Scene& scene) {
  geometry::ShapeTable table;
  for (const NamedShape& shape : scene.shapes) table.add(shape.description);
  double volume = 0;
  for (const ObjectSpec& object : scene.objects) volume += table.volume(object.shape.number());
  return volume;
}

bool within(float value, float low, float high) { return value >= low && value <= high; }

}  // namespace

TEST_CASE("the volume of all objects is `coverage` times the volume of the world") {
  for (const ShapeSetting setting : settings) {
    for (const double coverage : {0.01, 0.06, 0.3}) {
      CAPTURE(name_of(setting));
      PaperWorldOptions options;
      options.objects = 600;
      options.shapes = setting;
      options.coverage = coverage;
      const Scene scene = make_paper_world(options).scene;
      const double side = scene.bounds_max.x;
      CHECK(scene.bounds_max == Vec3d{side, side, side});
      CHECK(volume_of(scene) / (side * side * side) == doctest::Approx(coverage).epsilon(1e-9));
    }
  }
}

TEST_CASE("there is one avatar per user; half of the other objects are active and half non-active") {
  PaperWorldOptions options;
  const Scene scene = make_paper_world(options).scene;
  std::array<int, 4> categories{};
  std::set<UserId> users;
  std::set<ObjectNumber> numbers;
  for (const ObjectSpec& object : scene.objects) {
    ++categories[static_cast<std::size_t>(object.category)];
    numbers.insert(object.number);
    CHECK((object.category == Category::avatar) == (object.user != no_user));
    if (object.user != no_user) users.insert(object.user);
  }
  CHECK(categories == std::array<int, 4>{100, 1950, 1950, 0});
  CHECK(numbers.size() == 4000);
  CHECK(*numbers.rbegin() == 4000);
  CHECK(users.size() == 100);
  CHECK(users_of(scene) == 100);
}

TEST_CASE("mixed shapes are 1/6 spheres, 1/6 capsules, 1/3 boxes and 1/3 hulls in each category") {
  PaperWorldOptions options;
  options.objects = 6000;
  const Scene scene = make_paper_world(options).scene;
  std::array<std::array<int, 4>, 2> kinds{};
  for (const ObjectSpec& object : scene.objects) {
    if (object.category == Category::avatar) continue;
    ++kinds[object.category == Category::active][scene.shapes[object.shape.number()].description.index()];
  }
  for (const auto& of_category : kinds) {
    CHECK(std::abs(of_category[static_cast<std::size_t>(ShapeKind::sphere)] - 492) < 20);
    CHECK(std::abs(of_category[static_cast<std::size_t>(ShapeKind::capsule)] - 492) < 20);
    CHECK(std::abs(of_category[static_cast<std::size_t>(ShapeKind::box)] - 983) < 20);
    CHECK(std::abs(of_category[static_cast<std::size_t>(ShapeKind::hull)] - 983) < 20);
  }
}

TEST_CASE("the sizes of shapes are in the documented ranges") {
  const Scene scene = make_paper_world({}).scene;
  CHECK(scene.shapes.size() == 1 + 3 * 64);
  for (const NamedShape& shape : scene.shapes) {
    CAPTURE(shape.name);
    if (const auto* ball = std::get_if<Sphere>(&shape.description)) CHECK(ball->radius == 1.0f);
    if (const auto* box = std::get_if<Box>(&shape.description)) {
      const Vec3f& h = box->half_extents;
      CHECK((within(h.x, 0.6f, 1.2f) && within(h.y, 0.6f, 1.2f) && within(h.z, 0.6f, 1.2f)));
    }
    if (const auto* capsule = std::get_if<Capsule>(&shape.description)) {
      CHECK((within(capsule->radius, 0.4f, 0.8f) && within(capsule->half_height, 0.3f, 1.0f)));
    }
    if (const auto* hull = std::get_if<ConvexHull>(&shape.description)) {
      CHECK(hull->points.size() == 32);
      for (const Vec3f& p : hull->points) {
        const float length = std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
        CHECK(within(length, 0.59f, 1.21f));
      }
    }
  }
}

TEST_CASE("equal options give equal worlds, another seed gives another world") {
  PaperWorldOptions options;
  options.objects = 500;
  const PaperWorld one = make_paper_world(options), same = make_paper_world(options);
  options.seed = 2;
  const PaperWorld other = make_paper_world(options);
  bool differs = false;
  for (std::size_t i = 0; i < 500; ++i) {
    REQUIRE(one.scene.objects[i].pose == same.scene.objects[i].pose);
    differs = differs || !(one.scene.objects[i].pose == other.scene.objects[i].pose);
  }
  CHECK(differs);
  CHECK(one.steering.targets == 10);
}

TEST_CASE("the generated world has the recorded hash") {
  // Recorded with g++ 12 on x86-64. Another hash means that the generator's arithmetic has changed.
  PaperWorldOptions options;
  options.objects = 1000;
  const Scene scene = make_paper_world(options).scene;
  std::uint64_t hash = 0;
  const auto mix = [&hash](double value) {
    hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  };
  for (const ObjectSpec& object : scene.objects) {
    mix(object.pose.position.x);
    mix(object.pose.position.y);
    mix(object.pose.position.z);
    mix(double{object.pose.orientation.w});
    mix(object.shape.number());
  }
  CHECK(hash == 11777902483206191724u);
}

TEST_CASE("objects start within the bounds, with few contacts and few deep ones") {
  for (const ShapeSetting setting : settings) {
    CAPTURE(name_of(setting));
    PaperWorldOptions options;
    options.objects = 1000;
    options.shapes = setting;
    const Scene scene = make_paper_world(options).scene;
    reference::Shapes shapes;
    for (const NamedShape& shape : scene.shapes) shapes.add(shape.description);
    int contacts = 0, deep = 0;
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
      const ObjectSpec& p = scene.objects[i];
      const double side = scene.bounds_max.x;
      CHECK((p.pose.position.x >= 0 && p.pose.position.y >= 0 && p.pose.position.z >= 0));
      CHECK((p.pose.position.x <= side && p.pose.position.y <= side && p.pose.position.z <= side));
      for (std::size_t j = i + 1; j < scene.objects.size(); ++j) {
        const ObjectSpec& q = scene.objects[j];
        const double x = p.pose.position.x - q.pose.position.x, y = p.pose.position.y - q.pose.position.y,
                     z = p.pose.position.z - q.pose.position.z;
        const double reach = shapes[p.shape.number()].bounding_radius + shapes[q.shape.number()].bounding_radius;
        if (x * x + y * y + z * z > reach * reach) continue;
        const auto contact =
            reference::exact_contact(shapes[p.shape.number()], p.pose, shapes[q.shape.number()], q.pose);
        contacts += contact.has_value();
        deep += contact && contact->depth > 0.8f;
      }
    }
    CHECK(contacts > 200);
    CHECK(contacts < 875);
    CHECK(deep < 20);
  }
}

TEST_CASE("an option out of range is refused with its name and range") {
  const auto error_message_of = [](auto change) {
    PaperWorldOptions options;
    change(options);
    try {
      make_paper_world(options);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(error_message_of([](PaperWorldOptions& o) { o.objects = 0; }) == "objects: 0; expected 1 to 10000000");
  CHECK(error_message_of([](PaperWorldOptions& o) { o.coverage = 0; }) == "coverage: 0; expected 0.000001 to 0.6");
  CHECK(error_message_of([](PaperWorldOptions& o) { o.coverage = NAN; }) == "coverage: nan; expected 0.000001 to 0.6");
  CHECK(error_message_of([](PaperWorldOptions& o) { o.users = 4001; }) ==
        "users: 4001; expected at most one for each of the 4000 objects");
  CHECK(error_message_of([](PaperWorldOptions& o) {
          o.target_interval = {5, 4};
        }) == "interval 5:4: expected A:B frames with 1 <= A <= B <= 1000000000");
}

TEST_CASE("worlds of 1, 2 and 7 objects are generated") {
  for (const std::uint32_t objects : {1u, 2u, 7u}) {
    PaperWorldOptions options;
    options.objects = objects;
    options.users = 1;
    CHECK(make_paper_world(options).scene.objects.size() == objects);
  }
}

}  // namespace ringfence::worlds
