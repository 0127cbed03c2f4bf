// Monsters hunt a player whom they see: each asks what is near and whether anything hides it. The output is the same
// for any number of nodes and in every deployment. Usage:
//
//   hunt [NODES [user|user-server|user-collision]]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string_view>
#include <vector>

#include <ringfence/world.hpp>

namespace {

using namespace ringfence;

// [hunt]
/// Active objects walk to the nearest avatar that they see.
class Hunt final : public MotionModel {
 public:
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].category != Category::active) continue;
      const Senses& senses = *inputs[i].senses;
      const Vec3d& eye = inputs[i].pose.position;
      const Hit prey =
          senses.nearest({.point = eye, .distance = 12, .filter = {.categories = bit_of(Category::avatar)}});
      if (!prey) continue;
      const Vec3d way{prey.point.x - eye.x, prey.point.y - eye.y, prey.point.z - eye.z};
      const RayQuery line{.start = eye, .displacement = way, .filter = {.categories = bit_of(Category::fixed)}};
      if (senses.cast_any(line)) continue;  // something hides it
      const double step = std::min(0.5, std::max(0.0, prey.distance - 1) / 2) / std::max(prey.distance, 1e-9);
      outputs[i].pose.position.x += step * way.x;
      outputs[i].pose.position.y += step * way.y;
    }
  }
};
// [hunt]

Deployment deployment_of(std::string_view name) {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server}) {
    if (name == name_of(deployment)) return deployment;
  }
  return Deployment::user_collision;
}

}  // namespace

int main(int argc, char** argv) {
  // [world]
  WorldConfig config;
  config.bounds_max = {40, 40, 10};
  config.sense = 12;  // metres around each object
  config.motion = std::make_shared<Hunt>();
  // [world]
  config.nodes = static_cast<std::uint32_t>(argc > 1 ? std::atoi(argv[1]) : 2);
  config.deployment = deployment_of(argc > 2 ? argv[2] : "user-collision");
  World world(config);
  const ShapeId body = world.add_shape(Capsule{0.4f, 0.5f}), wall = world.add_shape(Box{{0.5f, 2, 2}});
  const UserId alice = world.connect().user;
  const ObjectId player =
      world.spawn({.shape = body, .category = Category::avatar, .user = alice, .pose = {{10, 8, 1}, {}}}).id;
  if (world.spawn({.shape = wall, .category = Category::fixed, .pose = {{15, 14, 2}, {}}}).status != Status::ok)
    return 1;
  std::vector<ObjectId> monsters;
  for (const Vec3d& at : {Vec3d{4, 14, 1}, Vec3d{18, 14, 1}, Vec3d{34, 30, 1}}) {
    monsters.push_back(world.spawn({.shape = body, .pose = {at, {}}}).id);
  }
  for (int frame = 0; frame <= 40; ++frame) {
    if (world.move(alice, player, {{10, 8 + 0.4 * frame, 1}, {}}) != Status::ok) return 1;
    if (world.advance() != Status::ok) return 1;
    if (frame % 10 != 0) continue;
    std::printf("frame %2d, player at y = %2.0f:", frame, 8 + 0.4 * frame);
    for (const ObjectId monster : monsters) {
      const Vec3d& at = world.object(monster).spec.pose.position;
      std::printf("  (%5.2f, %5.2f)", at.x, at.y);
    }
    std::printf("\n");
  }
}
