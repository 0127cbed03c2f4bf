// The recipes of docs/recipes.md, one function each. The argument selects one.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string_view>

#include <ringfence/digest.hpp>
#include <ringfence/world.hpp>

using namespace ringfence;

namespace {

/// Ends the program if the World has refused a call that it should accept.
void require_ok(Status status) {
  if (status != Status::ok) {
    std::printf("refused: %s\n", name_of(status));
    std::exit(1);
  }
}

ObjectId spawn(World& world, const ObjectSpec& spec) {
  const Spawned spawned = world.spawn(spec);
  require_ok(spawned.status);
  return spawned.id;
}

/// Prints what begins and ends in the last frame.
void print_changes(const char* when, const World& world) {
  std::size_t begun = 0;
  for (const Contact& contact : world.contacts()) begun += contact.phase == Phase::begin ? 1 : 0;
  std::printf("%s: %zu begin, %zu end\n", when, begun, world.ended().size());
}

void use_a_trigger_area() {
  // [trigger]
  WorldConfig config;
  config.layers.names = {"players", "walls", "areas"};
  config.layers.collide = {{0, 0}, {0, 1}, {0, 2}};  // areas touch players, nothing else
  World world(config);
  const ShapeId person = world.add_shape(Capsule{0.3f, 0.6f});
  const ShapeId area = world.add_shape(Box{{3, 3, 3}});
  const UserId user = world.connect().user;
  const ObjectId player = spawn(world, {.shape = person, .category = Category::avatar, .layer = 0, .user = user});
  const ObjectId shop =
      spawn(world, {.shape = area, .category = Category::fixed, .layer = 2, .pose = {{20, 20, 1}, {}}});

  for (const double x : {10.0, 18.0, 19.0, 30.0}) {
    require_ok(world.move(user, player, {{x, 20, 1}, {}}));
    require_ok(world.advance());
    for (const Contact& contact : world.collisions_of(user)) {
      if (contact.a != shop.number() && contact.b != shop.number()) continue;
      if (contact.phase == Phase::begin) std::printf("enters the shop at x = %g\n", x);
      if (contact.phase == Phase::end) std::printf("leaves the shop at x = %g\n", x);
    }
  }
  // [trigger]
}

void open_a_door() {
  World world(WorldConfig{});
  const ShapeId box = world.add_shape(Box{{1, 1, 1}});
  // [door]
  const ObjectId door = spawn(world, {.shape = box, .category = Category::active, .pose = {{10, 10, 1}, {}}});
  const ObjectId crate = spawn(world, {.shape = box, .category = Category::active, .pose = {{11, 10, 1}, {}}});
  require_ok(world.advance());
  print_changes("closed", world);
  require_ok(world.set_enabled(door, false));  // in no contact until it is enabled again
  require_ok(world.advance());
  print_changes("open", world);
  require_ok(world.set_enabled(door, true));
  require_ok(world.place(crate, {{30, 10, 1}, {}}));  // a teleport
  require_ok(world.advance());
  print_changes("closed, crate elsewhere", world);
  // [door]
}

void find_what_touches_an_object() {
  World world(WorldConfig{});
  const ShapeId ball = world.add_shape(Sphere{1});
  // [touches]
  const ObjectId hub = spawn(world, {.shape = ball, .pose = {{10, 10, 10}, {}}});
  for (const double x : {8.5, 11.5, 15.0}) {
    (void)spawn(world, {.shape = ball, .user_data = 7, .pose = {{x, 10, 10}, {}}});
  }
  require_ok(world.advance());
  for (const Contact& contact : world.collisions_of(hub)) {
    const bool hub_is_a = contact.a == hub.number();
    const ObjectId other = hub_is_a ? contact.object_b() : contact.object_a();
    const std::uint64_t data = hub_is_a ? contact.user_data_b : contact.user_data_a;
    std::printf("object %u at x = %g, user_data %d\n", other.number(), world.object(other).spec.pose.position.x,
                static_cast<int>(data));
  }
  // [touches]
}

void group_the_parts_of_a_vehicle() {
  World world(WorldConfig{});
  const ShapeId ball = world.add_shape(Sphere{1});
  // [group]
  for (const double x : {10.0, 11.0, 12.0}) {
    (void)spawn(world, {.shape = ball, .group = 5, .pose = {{x, 10, 10}, {}}});  // parts of vehicle 5
  }
  (void)spawn(world, {.shape = ball, .pose = {{13, 10, 10}, {}}});  // something else
  require_ok(world.advance());
  std::printf("%zu contacts\n", world.contacts().size());
  // [group]
}

// [input]
/// Steers avatars: the input is a direction, one byte for each axis.
class Steer final : public MotionModel {
 public:
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].input.size() != 2) continue;  // no input in this frame
      std::int8_t direction[2];
      std::memcpy(direction, inputs[i].input.data(), 2);
      outputs[i].pose.position.x += 0.1 * direction[0];
      outputs[i].pose.position.y += 0.1 * direction[1];
    }
  }
};
// [input]

void steer_by_input() {
  WorldConfig config;
  config.motion = std::make_shared<Steer>();
  World world(config);
  const ShapeId person = world.add_shape(Capsule{0.3f, 0.6f});
  const UserId user = world.connect().user;
  const ObjectId avatar = spawn(world, {.shape = person, .category = Category::avatar, .user = user});
  // [send]
  const std::int8_t direction[2] = {1, -1};  // as the client sent it
  for (int frame = 0; frame < 10; ++frame) {
    require_ok(world.input(user, avatar, std::as_bytes(std::span(direction))));
    require_ok(world.advance());
  }
  const Vec3d at = world.object(avatar).spec.pose.position;
  std::printf("the avatar stands at (%.1f, %.1f)\n", at.x, at.y);
  // [send]
}

// [digest]
std::uint64_t digest_of(std::uint32_t nodes) {
  WorldConfig config;
  config.nodes = nodes;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  for (int i = 0; i < 200; ++i) {
    (void)spawn(world, {.shape = ball, .pose = {{i * 37 % 50 + 1.0, i * 11 % 50 + 1.0, i * 7 % 10 + 1.0}, {}}});
  }
  Digest digest;
  for (int frame = 0; frame < 10; ++frame) {
    require_ok(world.advance());
    digest.add_frame(world.contacts());
  }
  return digest.value();
}
// [digest]

void lose_a_node() {
  // [loss]
  WorldConfig config;
  config.nodes = 3;
  config.deadlines.node_ms = 2000;  // several times the longest frame
  config.log = [](LogLevel, std::string_view line) {
    std::printf("%.*s\n", static_cast<int>(line.size()), line.data());
  };
  World world(config);
  require_ok(world.inject({.node = NodeId(1), .frame = 1, .stage = NodeStage::colliding}));
  for (int frame = 0; frame < 3; ++frame) require_ok(world.advance());
  std::printf("%u nodes\n", world.nodes());
  require_ok(world.resize(3));
  require_ok(world.advance());
  std::printf("%u nodes\n", world.nodes());
  // [loss]
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view recipe = argc > 1 ? argv[1] : "";
  if (recipe == "area") {
    use_a_trigger_area();
  } else if (recipe == "door") {
    open_a_door();
  } else if (recipe == "touches") {
    find_what_touches_an_object();
  } else if (recipe == "group") {
    group_the_parts_of_a_vehicle();
  } else if (recipe == "digest") {
    std::printf("%s\n", digest_of(0) == digest_of(3) ? "the same with 0 and 3 nodes" : "different");
  } else if (recipe == "input") {
    steer_by_input();
  } else if (recipe == "loss") {
    lose_a_node();
  } else {
    std::printf("usage: recipes area|door|touches|group|input|digest|loss\n");
    return 2;
  }
}
