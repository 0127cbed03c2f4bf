// Step 1 of the tutorial: a player walks into a wall and out again.
#include <cstdio>

#include <ringfence/world.hpp>

using namespace ringfence;

int main() {
  // [world]
  WorldConfig config;
  config.bounds_max = {40, 40, 10};  // metres
  config.nodes = 2;                  // worker threads
  World world(config);

  const ShapeId person = world.add_shape(Capsule{0.3f, 0.6f});
  const ShapeId wall = world.add_shape(Box{{0.5f, 5.0f, 2.0f}});
  // [world]

  // [spawn]
  const UserId alice = world.connect().user;
  const ObjectId avatar = world.spawn({.shape = person, .category = Category::avatar, .user = alice}).id;
  const Spawned obstacle = world.spawn({.shape = wall, .category = Category::fixed, .pose = {{12, 10, 2}, {}}});
  if (obstacle.status != Status::ok) {
    std::printf("the wall was refused: %s\n", name_of(obstacle.status));
    return 1;
  }
  // [spawn]

  // [frames]
  const double path[] = {10, 11, 11.5, 11.25, 10};  // metres along x, one position per frame
  for (const double x : path) {
    if (world.move(alice, avatar, {{x, 10, 1}, {}}) != Status::ok) return 1;
    if (world.advance() != Status::ok) return 1;
    std::printf("frame %d, x = %g:", static_cast<int>(world.frames()) - 1, x);
    for (const Contact& contact : world.collisions_of(alice)) {
      std::printf(" %s, depth %.2f m, normal (%g, %g, %g)", name_of(contact.phase), double{contact.depth},
                  double{contact.normal.x}, double{contact.normal.y}, double{contact.normal.z});
    }
    std::printf("\n");
  }
  // [frames]
}
