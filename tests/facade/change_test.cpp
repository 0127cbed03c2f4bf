// Changes of objects at run time: group, layer, shape and model state; removal of shapes.
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "facade/script.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

WorldConfig layered() {
  WorldConfig config;
  config.bounds_max = {16, 16, 16};
  config.layers.names = {"solid", "ghost"};
  config.layers.collide = {{0, 0}};
  return config;
}

TEST_CASE("a pair whose groups, layers or shapes change ends or begins its contact in that frame, whoever hosts it") {
  in_all_worlds(layered(), {0u, 1u, 3u}, [](const WorldConfig& config) {
    const Category categories[] = {Category::active, Category::fixed, Category::avatar};
    for (const Category category : categories) {
      CAPTURE(name_of(category));
      World world(config);
      const ShapeId ball = world.add_shape(Sphere{1}), pea = world.add_shape(Sphere{0.1f});
      const UserId user = world.connect().user;
      const UserId owner = category == Category::avatar ? user : no_user;
      // On a border of regions, so that a ghost is in contact too.
      const ObjectId still =
          world.spawn({.shape = ball, .category = category, .user = owner, .pose = {{8, 8, 8}, {}}}).id;
      const ObjectId other = world.spawn({.shape = ball, .group = 7, .pose = {{9.5, 8, 8}, {}}}).id;
      const auto phase_after = [&](std::string_view change) {
        CAPTURE(std::string(change));
        advance(world);
        const bool touching = !world.contacts().empty();
        const auto& list = touching ? world.contacts() : world.ended();
        return list.empty() ? "none" : name_of(list.front().phase);
      };
      CHECK(phase_after("spawn") == std::string("begin"));
      CHECK(phase_after("nothing") == std::string("persist"));
      for (const ObjectId changed : {still, other}) {
        REQUIRE(world.set_group(changed, changed == still ? 7 : 0) == Status::ok);
        CHECK(phase_after("group") == std::string(changed == still ? "end" : "begin"));
        if (changed == still) CHECK(phase_after("nothing") == std::string("none"));
      }
      for (const ObjectId changed : {still, other}) {
        REQUIRE(world.set_layer(changed, 1) == Status::ok);
        CHECK(phase_after("layer") == std::string("end"));
        CHECK(world.object(changed).spec.layer == 1);
        REQUIRE(world.set_layer(changed, 0) == Status::ok);
        CHECK(phase_after("layer") == std::string("begin"));
        CHECK(world.contacts()[0].layer_a == 0);
        REQUIRE(world.set_shape(changed, pea) == Status::ok);
        CHECK(phase_after("shape") == std::string("end"));
        CHECK(world.object(changed).spec.shape == pea);
        REQUIRE(world.set_shape(changed, ball) == Status::ok);
        CHECK(phase_after("shape") == std::string("begin"));
      }
      // Several changes of one cut apply in the order of the calls, also beside a placement.
      REQUIRE(world.set_shape(other, pea) == Status::ok);
      REQUIRE(world.place(other, {{8, 9.05, 8}, {}}) == Status::ok);
      REQUIRE(world.set_group(other, 9) == Status::ok);
      CHECK(phase_after("shape and place") == std::string("persist"));
      CHECK(world.contacts()[0].depth == doctest::Approx(0.05));
      CHECK(phase_after("nothing") == std::string("persist"));
    }
  });
}

/// Everything that a world shows of a frame.
std::vector<std::uint64_t> fingerprints(World& world, int frames) {
  std::vector<std::uint64_t> all;
  for (int frame = 0; frame < frames; ++frame) {
    advance(world);
    all.push_back(fingerprint(world));
  }
  return all;
}

TEST_CASE("an object that is changed before its first frame is one that was spawned so") {
  WorldConfig base = layered();
  base.motion = std::make_shared<BouncingModel>(9);
  in_all_worlds(base, {0u, 1u, 3u}, [](const WorldConfig& config) {
    std::vector<std::uint64_t> expected;
    for (const bool changed : {false, true}) {
      World world(config);
      const ShapeId shapes[] = {world.add_shape(Sphere{1}), world.add_shape(Box{{1, 0.5f, 0.7f}})};
      const UserId user = world.connect().user;
      for (ObjectNumber i = 0; i < 60; ++i) {
        const Category category = static_cast<Category>(i % 4);
        ObjectSpec spec{.number = i + 1,
                        .shape = shapes[i % 2],
                        .category = category,
                        .layer = i % 5 == 0 ? std::uint8_t{1} : std::uint8_t{0}};
        spec.group = i % 7;
        spec.user = category == Category::avatar ? user : no_user;
        const std::uint32_t x = i % 4 * 2, y = i / 4 % 4 * 2, z = i / 16 * 2;
        spec.pose.position = {1.0 + x, 1.0 + y, 1.0 + z};
        const ObjectSpec wanted = spec;
        if (changed) {
          spec.shape = shapes[1 - i % 2];
          spec.layer = 1;
          spec.group = 3;
        }
        const Spawned spawned = world.spawn(spec);
        REQUIRE(spawned.status == Status::ok);
        if (changed) {
          REQUIRE(world.set_group(spawned.id, wanted.group) == Status::ok);
          REQUIRE(world.set_layer(spawned.id, wanted.layer) == Status::ok);
          REQUIRE(world.set_shape(spawned.id, wanted.shape) == Status::ok);
        }
      }
      const std::vector<std::uint64_t> found = fingerprints(world, 8);
      CHECK(world.contacts().size() > 5);
      if (!changed) expected = found;
      CHECK(found == expected);
    }
  });
}

/// Objects that rest until a frame of their own, and then fly straight, far enough to change hosts.
class WakingModel : public MotionModel {
 public:
  static std::uint64_t first_frame(ObjectNumber number) { return 2 + number % 4; }
  std::size_t state_bytes() const noexcept override { return 8; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (frame < first_frame(inputs[i].number)) continue;
      const double step = inputs[i].pose.position.x < 8 ? 0.7 : -0.7;
      outputs[i].pose.position.x += inputs[i].number % 3 == 0 ? 3 * step : step;
      outputs[i].pose.position.y += inputs[i].number % 2 == 0 ? 0.2 : -0.2;
      std::memcpy(outputs[i].state, &frame, sizeof frame);
    }
  }
};

TEST_CASE("objects that move for the first time, also in the frame of a change, are the same in every deployment") {
  WorldConfig base = layered();
  base.motion = std::make_shared<WakingModel>();
  std::vector<std::uint64_t> expected;
  in_all_worlds(base, {0u, 1u, 3u, 8u}, [&](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1}), box = world.add_shape(Box{{1, 0.5f, 0.7f}});
    std::vector<ObjectId> ids;
    for (ObjectNumber i = 0; i < 120; ++i) {
      ObjectSpec spec{.number = i + 1, .shape = i % 2 == 0 ? ball : box};
      const std::uint32_t x = i % 8, y = i / 8 % 5, z = i / 40;
      spec.pose.position = {1.0 + 2.0 * x, 3.0 + 2.3 * y, 1.0 + 6.0 * z};
      ids.push_back(world.spawn(spec).id);
    }
    std::vector<std::uint64_t> prints;
    for (std::uint64_t frame = 0; frame < 9; ++frame) {
      CAPTURE(frame);
      REQUIRE(world.advance() == Status::ok);
      require_counts(world);
      prints.push_back(fingerprint(world));
      for (const ObjectId id : ids) {
        if (WakingModel::first_frame(id.number()) != frame + 1) continue;
        Status changed = Status::ok;
        switch (id.number() % 7) {
          case 0:
            changed = world.set_group(id, id.number() % 5);
            break;
          case 1:
            changed = world.set_layer(id, 1);
            break;
          case 2:
            changed = world.set_shape(id, box);
            break;
          case 3:
            changed = world.place(id, {{9, 9, 9}, {}});
            break;
          default:
            break;
        }
        REQUIRE(changed == Status::ok);
      }
    }
    CHECK(world.contacts().size() > 20);
    if (expected.empty()) expected = prints;
    CHECK(prints == expected);
  });
}

TEST_CASE(
    "random changes give the same states and contacts in every deployment, also when nodes join, leave and stop") {
  constexpr double side = 7;
  const auto run = [&](WorldConfig config, bool disturbed) {
    config.layers.names = {"solid", "ghost", "wall"};
    config.layers.collide = {{0, 0}, {0, 2}, {1, 2}};
    config.bounds_max = {side, side, side};
    config.motion = std::make_shared<BouncingModel>(side);
    config.deadlines.node_ms = disturbed ? 60 : 0;
    World world(config);
    Script script(world, 41, side);
    std::vector<std::uint64_t> prints;
    for (std::uint64_t frame = 0; frame < 40; ++frame) {
      CAPTURE(frame);
      if (disturbed && frame % 7 == 3) REQUIRE(world.resize(1 + frame % 4) == Status::ok);
      if (disturbed && frame % 10 == 8) {
        (void)world.inject(
            {world.report().nodes[0].id, frame, static_cast<NodeStage>(frame / 10), 0});  // it may be refused
      }
      REQUIRE(world.advance() == Status::ok);
      require_counts(world);
      prints.push_back(fingerprint(world));
      script.make_requests();
    }
    world.release_faults();
    return prints;
  };
  WorldConfig plain;
  plain.nodes = 0;
  const std::vector<std::uint64_t> expected = run(plain, false);
  in_all_worlds({}, {0u, 1u, 3u, 5u}, [&](const WorldConfig& config) {
    CHECK(run(config, false) == expected);
    if (config.nodes > 1) CHECK(run(config, true) == expected);
  });
}

TEST_CASE("the state of the model can be read after a frame and replaced before the next") {
  /// Its state is a number that grows by its first input byte, or by 1.
  class Counter : public MotionModel {
   public:
    std::size_t state_bytes() const noexcept override { return 5; }
    void start(const ObjectSpec& spec, std::byte* state) const override { write(spec.number * 1000, state); }
    void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
      for (std::size_t i = 0; i < inputs.size(); ++i) {
        write(read(inputs[i].state) + 1, outputs[i].state);
        outputs[i].pose.position.x += inputs[i].number % 2 == 0 ? 0.5 : 0;
      }
    }
    static std::uint32_t read(const std::byte* state) {
      std::uint32_t value;
      std::memcpy(&value, state + 1, sizeof value);
      return value;
    }
    static void write(std::uint32_t value, std::byte* state) { std::memcpy(state + 1, &value, sizeof value); }
  };
  WorldConfig base;
  base.motion = std::make_shared<Counter>();
  in_all_worlds(base, {0u, 1u, 3u}, [&](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    const UserId user = world.connect().user;
    std::vector<ObjectId> ids;
    std::vector<std::uint32_t> expected;
    for (ObjectNumber i = 0; i < 24; ++i) {
      const Category category = static_cast<Category>(i % 3);
      ObjectSpec spec{.number = i + 1, .shape = ball, .category = category};
      spec.user = category == Category::avatar ? user : no_user;
      spec.pose.position = {i * 4.0, i * 3.0, 1};
      ids.push_back(world.spawn(spec).id);
      expected.push_back(spec.number * 1000);
      CHECK(world.state(ids.back()).empty());
    }
    const ObjectId wall = world.spawn({.shape = ball, .category = Category::fixed}).id;
    for (std::uint32_t frame = 0; frame < 12; ++frame) {
      CAPTURE(frame);
      for (std::size_t i = frame; i < ids.size(); i += 5) {
        std::array<std::byte, 5> state{};
        expected[i] = 77 * frame + static_cast<std::uint32_t>(i);
        Counter::write(expected[i] + 9, state.data());
        REQUIRE(world.set_state(ids[i], state) == Status::ok);
        Counter::write(expected[i], state.data());
        REQUIRE(world.set_state(ids[i], state) == Status::ok);
      }
      if (frame == 6) REQUIRE(world.place(ids[3], {{1, 1, 1}, {}}) == Status::ok);
      REQUIRE(world.begin_frame() == Status::ok);
      CHECK(world.state(ids[0]).empty());
      REQUIRE(world.finish_frame() == Status::ok);
      require_counts(world);
      require_nothing_refused(world);
      for (std::size_t i = 0; i < ids.size(); ++i) {
        const std::span<const std::byte> state = world.state(ids[i]);
        REQUIRE(state.size() == 5);
        REQUIRE(Counter::read(state.data()) == ++expected[i]);
      }
    }
    std::array<std::byte, 6> bytes{};
    CHECK(world.set_state(ids[0], bytes) == Status::bad_message);
    CHECK(world.set_state(ids[0], std::span(bytes).first(4)) == Status::bad_message);
    CHECK(world.set_state(wall, std::span(bytes).first(5)) == Status::bad_category);
    CHECK(world.set_state({}, std::span(bytes).first(5)) == Status::stale_object);
    REQUIRE(world.advance() == Status::ok);
    CHECK(refused(world, Status::bad_message) == 2);
    CHECK(refused(world, Status::bad_category) == 1);
    CHECK(refused(world, Status::stale_object) == 1);
    for (std::size_t i = 0; i < ids.size(); ++i) CHECK(Counter::read(world.state(ids[i]).data()) == expected[i] + 1);
  });
}

TEST_CASE("a shape is removed when no object has it and no request names it, and its number is not used again") {
  in_all_worlds({}, {0u, 3u}, [](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    const ShapeId hull = world.add_shape(ConvexHull{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, 0, 1}}});
    const ShapeId mesh = world.add_shape(TriangleMesh{{{0, 0, 0}, {5, 0, 0}, {0, 5, 0}}, {0, 1, 2}});
    const ShapeId support = world.add_shape(SupportShape{std::make_shared<Ellipsoid>(Vec3f{0.5f, 0.7f, 0.9f})});
    std::vector<ObjectId> ids;
    std::uint64_t in_use = 0;
    const auto is_in_use = [&](ShapeId shape) {
      const bool used = world.remove_shape(shape) == Status::shape_in_use;
      in_use += used ? 1 : 0;
      return used;
    };
    for (const ShapeId shape : {hull, mesh, support}) {
      ids.push_back(world.spawn({.shape = shape, .category = Category::fixed, .pose = {{2, 2, 0}, {}}}).id);
      CHECK(is_in_use(shape));
    }
    const ObjectId mover = world.spawn({.shape = ball, .pose = {{2, 2, 0.5}, {}}}).id;
    REQUIRE(world.advance() == Status::ok);
    CHECK(world.contacts().size() == 3);
    CHECK(refused(world, Status::shape_in_use) == in_use);
    REQUIRE(world.set_shape(ids[0], ball) == Status::ok);
    REQUIRE(world.set_shape(ids[1], hull) == Status::ok);
    REQUIRE(world.destroy(ids[2]) == Status::ok);
    for (const ShapeId shape : {ball, hull, mesh, support}) CHECK(is_in_use(shape));
    REQUIRE(world.begin_frame() == Status::ok);
    CHECK(world.remove_shape(mesh) == Status::out_of_order);
    REQUIRE(world.finish_frame() == Status::ok);
    CHECK(is_in_use(ball));
    CHECK(is_in_use(hull));
    for (const ShapeId shape : {mesh, support}) {
      CHECK(world.has_shape(shape));
      CHECK(world.remove_shape(shape) == Status::ok);
      CHECK_FALSE(world.has_shape(shape));
      CHECK(world.remove_shape(shape) == Status::unknown_shape);
      CHECK(world.spawn({.shape = shape}).status == Status::unknown_shape);
      CHECK(world.set_shape(mover, shape) == Status::unknown_shape);
    }
    CHECK(world.shape_count() == 4);
    const ShapeId box = world.add_shape(Box{{1, 1, 1}});
    CHECK(box.number() == 4);
    REQUIRE(world.set_shape(ids[1], box) == Status::ok);
    CHECK(is_in_use(hull));
    REQUIRE(world.advance() == Status::ok);
    CHECK(refused(world, Status::unknown_shape) == 6);
    CHECK(world.remove_shape(hull) == Status::ok);
    CHECK(world.remove_shape(ShapeId(5)) == Status::unknown_shape);
    for (int frame = 0; frame < 3; ++frame) REQUIRE(world.advance() == Status::ok);
    CHECK(world.contacts().size() == 2);
  });
}

TEST_CASE("the memory of a removed shape stays while the thread of a lost node may read it") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    WorldConfig config;
    config.nodes = 2;
    config.placement = placement;
    config.deadlines.node_ms = 60;
    World world(config);
    std::vector<Vec3f> points;
    for (int i = 0; i < 200; ++i) {
      const auto angle = static_cast<float>(i) * 0.7f;
      points.push_back({angle - std::floor(angle), 0.3f * static_cast<float>(i % 7), static_cast<float>(i % 5)});
    }
    const ShapeId hull = world.add_shape(ConvexHull{points}), ball = world.add_shape(Sphere{1});
    std::vector<ObjectId> ids;
    for (int i = 0; i < 60; ++i) ids.push_back(world.spawn({.shape = hull, .pose = {{0.3 * i, 0.2 * i, 0}, {}}}).id);
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(world.inject({NodeId(0), 1, NodeStage::kernel, 0}) == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(world.report().lost.size() >= 1);
    for (const ObjectId id : ids) REQUIRE(world.set_shape(id, ball) == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(world.remove_shape(hull) == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    world.release_faults();
    const ShapeId again = world.add_shape(ConvexHull{points});
    CHECK(again.number() == 2);
    for (int frame = 0; frame < 5; ++frame) REQUIRE(world.advance() == Status::ok);
    CHECK(world.contacts().size() > 20);
  }
}

TEST_CASE("changes with a wrong object, layer or shape are refused and counted") {
  World world(layered());
  const ShapeId ball = world.add_shape(Sphere{1});
  const ObjectId id = world.spawn({.shape = ball}).id;
  advance(world);
  CHECK(world.set_group({}, 1) == Status::stale_object);
  CHECK(world.set_layer({}, 0) == Status::stale_object);
  CHECK(world.set_shape({}, ball) == Status::stale_object);
  CHECK(world.set_layer(id, 2) == Status::unknown_layer);
  CHECK(world.set_shape(id, ShapeId(1)) == Status::unknown_shape);
  CHECK(world.state(id).empty());
  CHECK(world.set_state(id, {}) == Status::ok);  // no model: no state
  REQUIRE(world.advance() == Status::ok);
  CHECK(refused(world, Status::stale_object) == 3);
  CHECK(refused(world, Status::unknown_layer) == 1);
  CHECK(refused(world, Status::unknown_shape) == 1);
  CHECK(world.object(id).spec.layer == 0);
}

}  // namespace
}  // namespace ringfence::test
