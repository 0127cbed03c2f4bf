// Contacts and distances of two shapes without a World.
#include <cstdio>

#include <ringfence/collide.hpp>

int main() {
  const ringfence::PreparedShape ball(ringfence::Sphere{0.5f});
  const ringfence::PreparedShape tower(ringfence::Box{{2, 2, 10}});
  const ringfence::Pose there{{20, 0, 10}, {0, 0, 0, 1}};
  for (const double x : {10.0, 17.75}) {
    const ringfence::Pose here{{x, 1, 5}, {0, 0, 0, 1}};
    const auto gap = ringfence::distance(ball, here, tower, there);
    const auto hit = ringfence::collide(ball, here, tower, there);
    std::printf("%g m apart, closest at x = %g", gap.distance, gap.point_b.x);
    if (hit.contact) std::printf(", overlap by %g m", double{hit.contact->depth});
    std::printf("\n");
  }
}
