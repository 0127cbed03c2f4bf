// Edge cases: empty worlds, everything in one place, far outside, no extent, layers, failing models.
#include <atomic>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

const std::vector<ShapeDescription>& all_shapes() {
  static const std::vector<ShapeDescription> shapes = {
      Sphere{1}, Box{{1, 0.5f, 2}}, Capsule{0.5f, 1},
      ConvexHull{{{1, 0, 0}, {-1, 0.2f, 0}, {0, 1, 0.3f}, {0.1f, -1, 0}, {0, 0, 1}, {0, 0, -1}}}};
  return shapes;
}

TEST_CASE("frames of a world without objects, with or without users, are empty") {
  in_all_worlds({}, {0u, 1u, 5u}, [](const WorldConfig& config) {
    World world(config);
    CHECK(world.contacts().empty());
    CHECK(world.frames() == 0);
    CHECK(world.objects().empty());
    CHECK(world.collisions_of(UserId(0)).empty());
    CHECK(world.seen_by(UserId(0)).empty());
    for (int frame = 0; frame < 3; ++frame) advance(world);
    for (int user = 0; user < 5; ++user) REQUIRE(world.connect().status == Status::ok);
    for (int frame = 0; frame < 3; ++frame) advance(world);
    CHECK(world.report().objects == 0);
    CHECK(world.frames() == 6);
  });
}

TEST_CASE("a single object is in no contact") {
  in_all_worlds({}, {0u, 3u}, [](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{500});
    const ObjectId id = world.spawn({.shape = ball}).id;
    for (int frame = 0; frame < 3; ++frame) advance(world);
    CHECK(world.report().candidates == 0);
    CHECK(world.object(id).spec.pose == Pose{});
  });
}

TEST_CASE("objects that all stand on one point are each in contact with every other, once") {
  WorldConfig base;
  base.bounds_max = {16, 16, 16};
  // The centre of the world is on a border of regions, and its corner on the border of the bounds.
  for (const Vec3d point : {Vec3d{8, 8, 8}, Vec3d{0, 0, 0}, Vec3d{16, 16, 16}, Vec3d{3.3, 4.4, 5.5}}) {
    in_all_worlds(base, {0u, 1u, 7u}, [&](const WorldConfig& config) {
      World world(config);
      std::size_t count = 0;
      for (const ShapeDescription& shape : all_shapes()) {
        const ShapeId number = world.add_shape(shape);
        for (int i = 0; i < 10; ++i, ++count)
          REQUIRE(world.spawn({.shape = number, .pose = {point, {}}}).status == Status::ok);
      }
      for (int frame = 0; frame < 2; ++frame) {
        advance(world);
        REQUIRE(world.contacts().size() == count * (count - 1) / 2);
        for (const Contact& contact : world.contacts()) {
          const double length = std::sqrt(double{contact.normal.x} * double{contact.normal.x} +
                                          double{contact.normal.y} * double{contact.normal.y} +
                                          double{contact.normal.z} * double{contact.normal.z});
          REQUIRE(std::abs(length - 1) < 1e-4);
          REQUIRE(contact.depth > 0);
          REQUIRE(std::isfinite(contact.point.x + contact.point.y + contact.point.z));
        }
      }
    });
  }
}

TEST_CASE("a world without extent holds objects like any other") {
  WorldConfig base;
  base.bounds_min = base.bounds_max = {5, -7, 1e6};
  std::uint64_t expected = 0;
  in_all_worlds(base, {0u, 1u, 6u}, [&](WorldConfig config) {
    config.motion = std::make_shared<BouncingModel>(10);
    World world(config);
    populate(world, 120, 3, 10);
    Digest digest;
    for (int frame = 0; frame < 10; ++frame) {
      advance(world);
      digest.add_frame(world.contacts());
    }
    CHECK(world.contacts().size() > 10);
    expected = expected == 0 ? digest.value() : expected;
    CHECK(digest.value() == expected);
  });
}

// Nodes join and leave twice in ten frames; the contacts of every frame are counted.
void check_resized(const WorldConfig& base, std::size_t objects, std::size_t contacts, const Vec3d& point) {
  in_all_worlds(base, {0u, 1u, 4u}, [&](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    for (std::size_t i = 0; i < objects; ++i)
      REQUIRE(world.spawn({.shape = ball, .pose = {point, {}}}).status == Status::ok);
    for (int frame = 0; frame < 10; ++frame) {
      if (frame == 1) REQUIRE(world.resize(7) == Status::ok);
      if (frame == 2) REQUIRE(world.resize(0) == Status::bad_number);
      if (frame == 4) REQUIRE(world.resize(1) == Status::ok);
      if (frame == 5) REQUIRE(world.resize(3) == Status::ok);
      REQUIRE(world.advance() == Status::ok);
      require_counts(world);
      REQUIRE(world.contacts().size() == contacts);
      REQUIRE(refused(world, Status::bad_number) == (frame == 2 ? 1 : 0));
    }
    CHECK(world.nodes() == 3);
  });
}

TEST_CASE(
    "nodes join and leave in a world that is empty, has one object, has all objects on one point, or has no extent") {
  check_resized({}, 0, 0, {});
  check_resized({}, 1, 0, {50, 50, 50});
  check_resized({}, 40, 780, {50, 50, 50});
  check_resized({}, 40, 780, {-1e6, 1e6, 0});
  WorldConfig flat;
  flat.bounds_min = flat.bounds_max = {3, 3, 3};
  check_resized(flat, 40, 780, {3, 3, 3});
}

TEST_CASE("more nodes than cells are refused when the world is made, and as many as cells work") {
  WorldConfig config;
  config.tuning.cells_log2[1] = 1;
  config.nodes = 3;
  CHECK_THROWS_WITH_AS(World{config}, doctest::Contains("3 nodes cannot share 2 cells"), Error);
  config.nodes = 2;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  for (int i = 0; i < 20; ++i)
    REQUIRE(world.spawn({.shape = ball, .pose = {{50, 41.0 + i, 50}, {}}}).status == Status::ok);
  advance(world);
  CHECK(world.contacts().size() == 19 + 18);  // neighbours, and those that touch the next but one
  CHECK(world.resize(3) == Status::bad_number);
}

TEST_CASE("far outside the bounds contacts are the same as inside, and coordinates beyond the limit are refused") {
  WorldConfig base;
  base.bounds_max = {10, 10, 10};
  for (const double far : {1e3, 1e6, -1e6}) {
    CAPTURE(far);
    in_all_worlds(base, {0u, 3u}, [&](const WorldConfig& config) {
      World world(config);
      std::vector<std::vector<Contact>> found;
      for (const ShapeDescription& shape : all_shapes()) world.add_shape(shape);
      // The same group twice, at the origin and far from it.
      for (const double x : {0.0, far}) {
        for (std::uint32_t shape = 0; shape < world.shape_count(); ++shape) {
          REQUIRE(world.spawn({.shape = ShapeId(shape), .pose = {{x + 0.5 * shape, 5, 5}, {}}}).status == Status::ok);
        }
      }
      advance(world);
      const auto half = static_cast<ObjectNumber>(world.shape_count());
      std::map<std::pair<ObjectNumber, ObjectNumber>, float> near_depths, far_depths;
      for (const Contact& contact : world.contacts()) {
        REQUIRE((contact.a <= half) == (contact.b <= half));
        if (contact.a <= half) {
          near_depths[{contact.a, contact.b}] = contact.depth;
        } else {
          far_depths[{contact.a - half, contact.b - half}] = contact.depth;
        }
      }
      CHECK(near_depths.size() == half * (half - 1) / 2);
      CHECK((near_depths == far_depths));  // positions are multiples of 1/2: exact at both places
    });
  }
  for (const double far : {1e9, 1e12, farthest_coordinate}) {
    CAPTURE(far);
    in_all_worlds(base, {0u, 2u}, [&](const WorldConfig& config) {
      World world(config);
      std::size_t together = 0;
      for (const ShapeDescription& shape : all_shapes()) {
        const ShapeId number = world.add_shape(shape);
        for (const double x : {far, far / 4, -far, -far / 4}) {
          REQUIRE(world.spawn({.shape = number, .pose = {{x, number.number() * far / 8, far}, {}}}).status ==
                  Status::ok);
        }
        REQUIRE(world.spawn({.shape = number, .pose = {{far, far, far}, {}}}).status == Status::ok);
        ++together;
      }
      advance(world);
      CHECK(world.contacts().size() == together * (together - 1) / 2);
    });
  }
  World world(base);
  const ShapeId ball = world.add_shape(Sphere{1});
  for (const double beyond : {1.001 * farthest_coordinate, -1e30, 1e308}) {
    CHECK(world.spawn({.shape = ball, .pose = {{0, 0, beyond}, {}}}).status == Status::not_finite);
  }
}

TEST_CASE("layers collide as in the matrix, in both directions") {
  WorldConfig base;
  base.layers.names = {"solid", "ghost", "water", "wall"};
  base.layers.collide = {{0, 0}, {2, 0}, {3, 3}, {1, 2}};
  const auto collide = [&](std::uint8_t p, std::uint8_t q) {
    for (const auto& [a, b] : base.layers.collide) {
      if ((a == p && b == q) || (a == q && b == p)) return true;
    }
    return false;
  };
  in_all_worlds(base, {0u, 3u}, [&](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    std::map<ObjectNumber, std::uint8_t> layers;
    for (int i = 0; i < 12; ++i) {
      const auto layer = static_cast<std::uint8_t>(i % 4);
      const ObjectId id = world.spawn({.shape = ball, .layer = layer, .pose = {{50 + 0.1 * i, 50, 50}, {}}}).id;
      layers[id.number()] = layer;
    }
    advance(world);
    std::set<std::pair<ObjectNumber, ObjectNumber>> expected;
    for (const auto& [p, p_layer] : layers) {
      for (const auto& [q, q_layer] : layers) {
        if (p < q && collide(p_layer, q_layer)) expected.insert({p, q});
      }
    }
    CHECK(world.report().candidates == expected.size());
    REQUIRE(world.contacts().size() == expected.size());
    for (const Contact& contact : world.contacts()) CHECK(expected.count({contact.a, contact.b}) == 1);
  });
}

/// Records the objects that it is asked to move.
class RecordingModel : public MotionModel {
 public:
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput>) const override {
    for (const MotionInput& in : inputs) {
      if (in.user_data != in.number * std::uint64_t{0x100000001}) wrong.fetch_add(1);
      if (in.category == Category::fixed) fixed.fetch_add(1);
      moved.fetch_add(1);
    }
  }
  mutable std::atomic<std::uint64_t> wrong{0}, fixed{0}, moved{0};
};

TEST_CASE("the model gets each object that can move once per frame, with its user data, and never a static one") {
  in_all_worlds({}, {0u, 3u}, [&](WorldConfig config) {
    const auto model = std::make_shared<RecordingModel>();
    config.motion = model;
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    for (int user = 0; user < 3; ++user) REQUIRE(world.connect().status == Status::ok);
    std::uint64_t movable = 0;
    std::vector<ObjectId> fixed;
    for (ObjectNumber number = 1; number <= 200; ++number) {
      ObjectSpec spec{.number = number, .shape = ball};
      spec.category = static_cast<Category>(number % 4);
      if (spec.category == Category::avatar) spec.user = UserId(number % 3);
      spec.user_data = number * std::uint64_t{0x100000001};
      spec.pose.position = {static_cast<double>(number % 20) * 1.5, static_cast<double>(number / 20) * 5, 0};
      const ObjectId id = world.spawn(spec).id;
      movable += spec.category != Category::fixed ? 1 : 0;
      if (spec.category == Category::fixed) fixed.push_back(id);
    }
    for (int frame = 0; frame < 4; ++frame) advance(world);
    CHECK(model->moved == 4 * movable);
    CHECK(model->wrong == 0);
    CHECK(model->fixed == 0);
    for (const ObjectId id : fixed) {
      const ObjectView view = world.object(id);
      CHECK(view.spec.category == Category::fixed);
      CHECK(view.spec.user_data == id.number() * std::uint64_t{0x100000001});
    }
    std::uint64_t with_fixed = 0;
    for (const Contact& contact : world.contacts()) {
      with_fixed += contact.a % 4 == 3 || contact.b % 4 == 3 ? 1 : 0;
    }
    CHECK(with_fixed > 0);  // static objects still have contacts
  });
}

/// Throws for some objects in some frames, returns invalid poses for others, and counts its moves in its state.
class FailingModel : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return 8; }
  void start(const ObjectSpec& spec, std::byte*) const override {
    if (spec.number == 13) throw std::runtime_error("start");
  }
  static int kind(ObjectNumber number, std::uint64_t frame) {
    return frame < 2 || frame > 6 ? 3 : static_cast<int>((number * 7 + frame) % 9);
  }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      outputs[i].pose.position.x += 0.25;
      outputs[i].state[0] = static_cast<std::byte>(std::to_integer<int>(inputs[i].state[0]) + 1);
      switch (kind(inputs[i].number, frame)) {
        case 0:
          throw std::runtime_error("move " + std::to_string(inputs[i].number) + std::string(300, '.'));
        case 1:
          outputs[i].pose.position.y = std::nan("");
          break;
        case 2:
          outputs[i].pose.orientation = {3, 0, 0, 0};
          break;
        default:
          break;
      }
    }
  }
};

TEST_CASE("if the model throws or returns invalid poses, only those objects do not move, in every deployment") {
  std::uint64_t expected = 0;
  in_all_worlds({}, {0u, 1u, 3u}, [&](WorldConfig config) {
    config.motion = std::make_shared<FailingModel>();
    std::vector<std::string> logged;
    config.log = [&](LogLevel, std::string_view line) { logged.emplace_back(line); };
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    for (int user = 0; user < 3; ++user) REQUIRE(world.connect().status == Status::ok);
    std::map<ObjectNumber, double> x;
    for (ObjectNumber number = 1; number <= 150; ++number) {
      ObjectSpec spec{.number = number, .shape = ball};
      spec.category = number % 10 == 0 ? Category::avatar : Category::active;
      spec.user = number % 10 == 0 ? UserId(number % 3) : no_user;
      spec.pose.position = {static_cast<double>(number % 15) * 6, static_cast<double>(number / 15) * 6, 0};
      x[number] = spec.pose.position.x;
      REQUIRE(world.spawn(spec).status == Status::ok);
    }
    Digest digest;
    for (std::uint64_t frame = 0; frame < 9; ++frame) {
      CAPTURE(frame);
      REQUIRE(world.advance() == Status::ok);
      require_counts(world);
      std::uint64_t kinds[3] = {};
      for (auto& [number, at] : x) {
        const int kind = FailingModel::kind(number, frame);
        if (kind < 3) {
          ++kinds[kind];
        } else {
          at += 0.25;
        }
        REQUIRE(world.object(world.find(number)).spec.pose.position.x == at);
      }
      REQUIRE(refused(world, Status::model_failed) == kinds[0] + (frame == 0 ? 1 : 0));
      REQUIRE(world.report().model_failures.size() ==
              std::min<std::uint64_t>(max_model_failures, refused(world, Status::model_failed)));
      ObjectNumber next = 1;
      for (const ModelFailure& failure : world.report().model_failures) {
        while (frame == 0 ? next != 13 : FailingModel::kind(next, frame) != 0) ++next;
        REQUIRE(failure.object == world.find(next));
        const std::string text = "move " + std::to_string(next) + std::string(300, '.');
        REQUIRE(failure.text == (frame == 0 ? "start" : text.substr(0, max_model_failure_text)));
        ++next;
      }
      REQUIRE(refused(world, Status::not_finite) == kinds[1]);
      REQUIRE(refused(world, Status::not_unit) == kinds[2]);
      digest.add_frame(world.contacts());
    }
    expected = expected == 0 ? digest.value() : expected;
    CHECK(digest.value() == expected);
    REQUIRE(logged.size() >= 2);
    CHECK(logged.size() <= 100);
    CHECK(logged[0] == "frame 0: the motion model threw for object 13: start");
    CHECK(logged[1].find("frame 2: the motion model threw for object") == 0);
  });
}

TEST_CASE("a disabled object is in no contact until it gets a pose") {
  in_all_worlds({}, {0u, 2u}, [&](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    const UserId user = world.connect().user;
    REQUIRE(world.spawn({.shape = ball, .pose = {{1, 0, 0}, {}}}).status == Status::ok);
    const ObjectId disabled = world.spawn({.shape = ball, .enabled = false}).id;
    const ObjectId avatar =
        world.spawn({.shape = ball, .category = Category::avatar, .enabled = false, .user = user}).id;
    advance(world);
    CHECK(world.contacts().empty());
    CHECK(world.report().objects == 3);
    CHECK_FALSE(world.object(disabled).spec.enabled);
    CHECK(world.place(disabled, {}) == Status::ok);
    advance(world);
    CHECK(world.contacts().size() == 1);
    CHECK(world.move(user, avatar, {}) == Status::ok);
    advance(world);
    CHECK(world.contacts().size() == 3);
  });
}

/// Moves each object by its state, which counts the moves of an enabled object.
class CountingModel final : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return sizeof(std::uint64_t); }
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (!inputs[i].enabled) continue;
      std::uint64_t moves = 0;
      std::memcpy(&moves, inputs[i].state, sizeof moves);
      outputs[i].pose.position.y += static_cast<double>(++moves);
      std::memcpy(outputs[i].state, &moves, sizeof moves);
    }
  }
};

TEST_CASE("an object that is disabled and enabled again keeps its pose and its model's state") {
  WorldConfig base;
  base.motion = std::make_shared<CountingModel>();
  in_all_worlds(base, {0u, 2u}, [&](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    const ObjectId still = world.spawn({.shape = ball, .category = Category::fixed, .pose = {{0, 3, 0}, {}}}).id;
    const ObjectId object = world.spawn({.shape = ball}).id;
    REQUIRE(still);
    const auto y = [&] { return world.object(object).spec.pose.position.y; };
    advance(world);
    advance(world);
    CHECK(y() == 3);
    CHECK(world.contacts().size() == 1);
    CHECK(world.set_enabled(object, false) == Status::ok);
    advance(world);
    CHECK(world.contacts().empty());
    CHECK(world.ended().size() == 1);
    advance(world);
    CHECK(y() == 3);
    // The last call before a frame counts.
    CHECK(world.set_enabled(object, true) == Status::ok);
    CHECK(world.set_enabled(object, false) == Status::ok);
    advance(world);
    CHECK_FALSE(world.object(object).spec.enabled);
    CHECK(world.set_enabled(object, false) == Status::ok);
    CHECK(world.set_enabled(object, true) == Status::ok);
    advance(world);
    CHECK(world.object(object).spec.enabled);
    CHECK(y() == 3 + 3);
    // Enabling an enabled object changes nothing.
    CHECK(world.set_enabled(object, true) == Status::ok);
    advance(world);
    CHECK(y() == 3 + 3 + 4);
  });
}

}  // namespace
}  // namespace ringfence::test
