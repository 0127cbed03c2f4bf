// The smallest use of Ringfence: the lines that README.md shows, as a program.
#include <cstdio>

#include <ringfence/world.hpp>

int main() {
  ringfence::WorldConfig config;
  config.bounds_max = {1000, 1000, 100};
  config.nodes = 2;
  ringfence::World world(config);
  const auto ball = world.add_shape(ringfence::Sphere{1.0f});
  const auto crate = world.add_shape(ringfence::Box{{0.5f, 0.5f, 0.5f}});
  const auto alice = world.connect().user;
  const auto hero = world.spawn({.shape = ball, .category = ringfence::Category::avatar, .user = alice}).id;
  const ringfence::ObjectSpec wall = {
      .shape = crate, .category = ringfence::Category::fixed, .pose = {{11.25, 10, 5}, {0, 0, 0, 1}}};
  if (world.spawn(wall).status != ringfence::Status::ok) return 1;
  if (world.move(alice, hero, {{10, 10, 5}, {0, 0, 0, 1}}) != ringfence::Status::ok) return 1;
  if (world.advance() != ringfence::Status::ok) return 1;
  for (const ringfence::Contact& contact : world.collisions_of(alice)) {
    std::printf("%u and %u overlap by %g m\n", contact.a, contact.b, double{contact.depth});
  }
}
