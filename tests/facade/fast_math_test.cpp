// An embedder that is compiled and linked with -ffast-math: its threads start with denormals flushed to zero.
#include <cstdint>
#include <memory>

#include <doctest/doctest.h>

#include "base/caller_environment.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

/// Balls in contact, whose contacts' points and normals are subnormal numbers.
std::uint64_t run(std::uint32_t nodes) {
  WorldConfig config;
  config.bounds_max = {10, 10, 10};
  config.nodes = nodes;
  World world(config);
  ObjectSpec spec;
  spec.shape = world.add_shape(Sphere{0.5f});
  for (int i = 0; i < 8; ++i) {
    spec.pose.position = {i % 2 == 0 ? 3e-310 : -1e-310, 1, 1 + 0.75 * i};
    REQUIRE(world.spawn(spec).status == Status::ok);
    spec.pose.position = {i % 2 == 0 ? 1e-40 : -3e-41, 5, 1 + 0.75 * i};
    REQUIRE(world.spawn(spec).status == Status::ok);
  }
  Digest digest;
  for (int frame = 0; frame < 3; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(world.contacts().size() == 14);
    digest.add_frame(world.contacts());
  }
  return digest.value();
}

TEST_CASE("a program that is linked with -ffast-math gets the contacts of one that is not") {
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
  REQUIRE(floating_point_modes() == call_from(Caller::flushing, floating_point_modes));
#endif
  for (const std::uint32_t nodes : {0u, 2u}) {
    CAPTURE(nodes);
    CHECK(run(nodes) == call_from(Caller::usual, [&] { return run(nodes); }));
  }
}

}  // namespace
}  // namespace ringfence::test
