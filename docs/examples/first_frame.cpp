// The smallest use of Ringfence: the lines that README.md shows, as a program.
#include <cstdio>

#include <ringfence/world.hpp>

using namespace ringfence;

int main() {
  WorldConfig config;
  config.nodes = 2;  // worker threads
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1.0f}), crate = world.add_shape(Box{{0.5f, 0.5f, 0.5f}});
  const UserId alice = world.connect().user;
  const ObjectId hero = world.spawn({.shape = ball, .category = Category::avatar, .user = alice}).id;
  (void)world.spawn({.shape = crate, .category = Category::fixed, .pose = {{11.25, 10, 5}, {}}});
  if (world.move(alice, hero, {{10, 10, 5}, {}}) != Status::ok || world.advance() != Status::ok) return 1;
  for (const Contact& contact : world.collisions_of(alice))
    std::printf("%u and %u overlap by %g m\n", contact.a, contact.b, double{contact.depth});
}
