// A minimal game server that checks that the installed library works: two CD node threads find the contact of two
// spheres that overlap and none with a third.

#include <cstdio>
#include <utility>

#include <ringfence/world.hpp>

#include "every_header.hpp"  // written by consume.cmake: all that is installed

int main() {
  ringfence::WorldConfig config;
  config.nodes = 2;
  ringfence::World made(config);
  ringfence::World world = std::move(made);
  const ringfence::ShapeId ball = world.add_shape(ringfence::Sphere{1.0f});
  const ringfence::UserId user = world.connect().user;

  const ringfence::Vec3d positions[] = {{50, 50, 50}, {51.5, 50, 50}, {10, 10, 10}};
  for (const auto& position : positions) {
    ringfence::ObjectSpec spec;
    spec.shape = ball;
    spec.category = ringfence::Category::avatar;
    spec.user = user;
    spec.pose.position = position;
    if (world.spawn(spec).status != ringfence::Status::ok) return 1;
  }
  if (world.advance() != ringfence::Status::ok) return 1;

  const auto contacts = world.collisions_of(user);
  if (contacts.size() != 1) {
    std::printf("expected 1 contact, found %zu\n", contacts.size());
    return 1;
  }
  for (const ringfence::Contact& contact : world.collisions_of(world.find(contacts[0].b))) {
    if (contact.a != contacts[0].a) return 1;
  }
  std::printf("objects %u and %u overlap by %g m\n", contacts[0].a, contacts[0].b, double{contacts[0].depth});
  return contacts[0].depth == 0.5f ? 0 : 1;
}
