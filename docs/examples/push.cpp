// Step 2 of the tutorial: a player pushes a crate. A motion model moves the crate.
#include <cstdio>
#include <memory>

#include <ringfence/world.hpp>

using namespace ringfence;

namespace {

// [model]
/// Moves each object out of what it touches, except avatars, which their users move.
class Push final : public MotionModel {
 public:
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].category == Category::avatar) continue;
      for (const Contact& contact : inputs[i].contacts) {
        // The normal points from a to b.
        const double away = contact.a == inputs[i].number ? -1.0 : 1.0;
        outputs[i].pose.position.x += away * double{contact.depth} * double{contact.normal.x};
        outputs[i].pose.position.y += away * double{contact.depth} * double{contact.normal.y};
      }
    }
  }
};
// [model]

}  // namespace

int main() {
  // [world]
  WorldConfig config;
  config.bounds_max = {40, 40, 10};
  config.nodes = 2;
  config.motion = std::make_shared<Push>();
  World world(config);
  const ShapeId person = world.add_shape(Capsule{0.3f, 0.6f});
  const ShapeId box = world.add_shape(Box{{0.5f, 0.5f, 0.5f}});

  const UserId alice = world.connect().user;
  const ObjectId avatar = world.spawn({.shape = person, .category = Category::avatar, .user = alice}).id;
  const ObjectId crate = world.spawn({.shape = box, .category = Category::non_active, .pose = {{11, 10, 0.5}, {}}}).id;
  // [world]

  // [frames]
  for (int frame = 0; frame < 8; ++frame) {
    const double x = 10 + 0.25 * frame;
    if (world.move(alice, avatar, {{x, 10, 1}, {}}) != Status::ok) return 1;
    if (world.advance() != Status::ok) return 1;
    std::printf("player at %.2f, crate at %.2f, %zu contacts\n", x, world.object(crate).spec.pose.position.x,
                world.contacts().size());
  }
  // [frames]
}
