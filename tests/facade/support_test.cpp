// Support functions that throw or return what cannot be, in whole worlds.
#include <atomic>
#include <cstdint>
#include <latch>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "geometry/ellipsoid.hpp"
#include "geometry/gapped_ellipsoid.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/error.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 7;
constexpr float infinity = std::numeric_limits<float>::infinity();

WorldConfig config_of(std::vector<std::string>* log = nullptr) {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.user_threads = 2;
  config.interest = 3;
  config.motion = std::make_shared<BouncingModel>(side);
  if (log != nullptr) config.log = [log](LogLevel, std::string_view line) { log->emplace_back(line); };
  return config;
}

std::size_t lines_with(const std::vector<std::string>& log, const std::string& text) {
  std::size_t count = 0;
  for (const std::string& line : log) count += line.find(text) != std::string::npos ? 1 : 0;
  return count;
}

/// `count` of the shape among the others of populate(), where they keep touching.
void spawn_among(World& world, ShapeId shape, int count) {
  for (int i = 0; i < count; ++i) {
    ObjectSpec spec;
    spec.shape = shape;
    spec.category = i % 3 == 0 ? Category::non_active : Category::active;
    spec.pose.position = {0.7 + 0.9 * (i % 7), 0.8 + 1.7 * (i / 7 % 4), 1 + 2.5 * (i / 28)};
    REQUIRE(world.spawn(spec).status == Status::ok);
  }
}

struct Run {
  std::uint64_t digest = 0, contacts = 0, candidates = 0, failed = 0;
  bool operator==(const Run&) const = default;
};

Run run(const WorldConfig& config, std::vector<std::string>& log) {
  log.clear();
  World world(config);
  populate(world, 60, 4, side);
  spawn_among(world, world.add_shape(SupportShape{gapped_ellipsoid()}), 20);
  spawn_among(world, world.add_shape(SupportShape{std::make_shared<Ellipsoid>(Vec3f{0.5f, 0.8f, 0.7f})}), 20);
  Digest digest;
  Run result;
  for (int frame = 0; frame < 20; ++frame) {
    CAPTURE(frame);
    advance(world);
    const FrameReport& report = world.report();
    std::uint64_t failed = 0;
    for (const NodeReport& node : report.nodes) failed += node.failed_supports;
    REQUIRE(failed == report.failed_supports);
    digest.add_frame(world.contacts());
    result.contacts += report.contacts;
    result.candidates += report.candidates;
    result.failed += report.failed_supports;
  }
  result.digest = digest.value();
  return result;
}

TEST_CASE("a support function that throws fails the same pairs in every deployment, placement and node count") {
  std::vector<std::string> log;
  WorldConfig config = config_of(&log);
  config.nodes = 0;
  const Run expected = run(config, log);
  CHECK(expected.contacts > 500);
  CHECK(expected.failed > 20);
  in_all_worlds(config_of(&log), {0u, 1u, 4u}, [&](const WorldConfig& other) {
    const Run got = run(other, log);
    CHECK(got == expected);
    CHECK(lines_with(log, "shape 3: support(): no point in this direction; pairs for which it fails have no contact") ==
          1);
    CHECK(log.size() == 1);
  });
}

/// An ellipsoid that can be broken, in several ways.
class Breakable : public SupportFunction {
 public:
  enum class DuplexChannel { whole, throws, throws_int, not_a_number, infinite, far, centre_throws };
  std::atomic<DuplexChannel> channel{DuplexChannel::whole};
  Vec3f support(Vec3f d) const override {
    switch (channel) {
      case DuplexChannel::throws:
        throw std::runtime_error("broken");
      case DuplexChannel::throws_int:
        throw 42;
      case DuplexChannel::not_a_number:
        return {0, std::numeric_limits<float>::quiet_NaN(), 0};
      case DuplexChannel::infinite:
        return {0, 0, -infinity};
      case DuplexChannel::far:
        return {d.x * 1e30f, d.y, d.z};
      default:
        return Ellipsoid({0.6f, 0.7f, 0.9f}).support(d);
    }
  }
  Vec3f centre() const override {
    if (channel == DuplexChannel::centre_throws) throw std::runtime_error("no centre");
    return {};
  }
};

TEST_CASE(
    "while a support function fails its shape has no contacts, the others have theirs, and then it has them again") {
  struct Failure {
    Breakable::DuplexChannel channel;
    const char* logged;
  };
  for (const Failure& failure :
       {Failure{Breakable::DuplexChannel::throws, "shape 3: support(): broken; pairs"},
        {Breakable::DuplexChannel::throws_int, "shape 3: support(): an exception that is no std::exception"},
        {Breakable::DuplexChannel::not_a_number, "shape 3: support(): a point that is not finite"},
        {Breakable::DuplexChannel::infinite, "shape 3: support(): a point that is not finite"},
        {Breakable::DuplexChannel::far, "shape 3: support(): a point that is not finite, or outside"},
        {Breakable::DuplexChannel::centre_throws, "shape 3: centre(): no centre; pairs"}}) {
    for (const std::uint32_t nodes : {0u, 2u}) {
      CAPTURE(failure.logged);
      CAPTURE(nodes);
      std::vector<std::string> log;
      WorldConfig config = config_of(&log);
      config.nodes = nodes;
      World world(config);
      populate(world, 20, 2, side);
      auto function = std::make_shared<Breakable>();
      const ShapeId shape = world.add_shape(SupportShape{function});
      REQUIRE(shape == ShapeId(3));
      spawn_among(world, shape, 40);
      const auto contacts_of_shape = [&] {
        std::size_t count = 0;
        for (const Contact& contact : world.contacts()) {
          for (const ObjectNumber number : {contact.a, contact.b}) {
            count += world.object(world.find(number)).spec.shape == shape ? 1 : 0;
          }
        }
        return count;
      };
      advance(world);
      CHECK(contacts_of_shape() > 10);
      CHECK(world.report().failed_supports == 0);
      function->channel = failure.channel;
      for (int frame = 0; frame < 3; ++frame) {
        // Bounds are needed while it is broken, too: of objects that come, that are placed, and that move.
        ObjectSpec spec;
        spec.shape = shape;
        spec.pose.position = {1 + frame * 1.0, 2, 3};
        const ObjectId object = world.spawn(spec).id;
        REQUIRE(world.place(object, {{2, 2, 2 + frame * 0.5}, {}}) == Status::ok);
        advance(world);
        CHECK(contacts_of_shape() == 0);
        CHECK(world.report().failed_supports > 10);
      }
      function->channel = Breakable::DuplexChannel::whole;
      advance(world);
      CHECK(contacts_of_shape() > 10);
      CHECK(world.report().failed_supports == 0);
      CHECK(lines_with(log, failure.logged) == 1);
      CHECK(log.size() == 1);
    }
  }
}

/// Each of two threads that call it waits once for the other, and then it throws in both.
class ThrowsInTwo : public SupportFunction {
 public:
  std::atomic<bool> armed{false};
  mutable std::latch both{2};
  Vec3f support(Vec3f d) const override {
    if (!armed) return Ellipsoid({0.6f, 0.7f, 0.9f}).support(d);
    thread_local const ThrowsInTwo* waited = nullptr;
    if (waited != this) {
      waited = this;
      both.arrive_and_wait();
    }
    throw std::runtime_error("in two threads");
  }
};

TEST_CASE("a support function that throws in two nodes at the same time ends neither") {
  std::vector<std::string> log;
  WorldConfig config = config_of(&log);
  config.nodes = 2;
  config.placement = Placement::region;
  config.balance = false;
  World world(config);
  auto function = std::make_shared<ThrowsInTwo>();
  const ShapeId shape = world.add_shape(SupportShape{function});
  // Pairs in all eight corners, so that each node hosts some and has some to test, slowly pushed apart.
  for (int corner = 0; corner < 8; ++corner) {
    for (const double offset : {0.0, 0.5}) {
      ObjectSpec spec;
      spec.shape = shape;
      spec.category = Category::non_active;
      spec.pose.position = {(corner & 1) != 0 ? 6.0 : 1.0, (corner & 2) != 0 ? 6.0 : 1.0,
                            ((corner & 4) != 0 ? 5.5 : 1.0) + offset};
      REQUIRE(world.spawn(spec).status == Status::ok);
    }
  }
  advance(world);
  advance(world);
  for (const NodeReport& node : world.report().nodes) {
    REQUIRE(node.hosted > 0);
    REQUIRE(node.tested > 0);
  }
  function->armed = true;
  advance(world);
  CHECK(world.contacts().empty());
  CHECK(world.report().failed_supports == world.report().tested);
  CHECK(log.size() == 1);
  function->armed = false;
  advance(world);
  CHECK_FALSE(world.contacts().empty());
}

TEST_CASE("a support function that fails while it is registered is refused with its reason, and leaves no shape") {
  struct Always : SupportFunction {
    Vec3f support(Vec3f) const override { throw std::runtime_error("not today"); }
  };
  struct Sevens : SupportFunction {
    Vec3f support(Vec3f) const override { throw 7; }
  };
  World world(config_of());
  const auto refusal = [&](std::shared_ptr<const SupportFunction> function) -> std::string {
    try {
      world.add_shape(SupportShape{std::move(function)});
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  };
  CHECK(refusal(std::make_shared<Always>()) == "support shape: its function threw: not today");
  CHECK(refusal(std::make_shared<Sevens>()) ==
        "support shape: its function threw an exception that is no std::exception");
  auto broken = std::make_shared<Breakable>();
  broken->channel = Breakable::DuplexChannel::not_a_number;
  CHECK(refusal(broken).find("support point 0 has the coordinate nan m") == 0);
  broken->channel = Breakable::DuplexChannel::infinite;
  CHECK(refusal(broken).find("support point 0 has the coordinate -inf m") == 0);
  broken->channel = Breakable::DuplexChannel::centre_throws;
  CHECK(refusal(broken) == "support shape: its function threw: no centre");
  CHECK(world.shape_count() == 0);
  broken->channel = Breakable::DuplexChannel::whole;
  CHECK(world.add_shape(SupportShape{broken}) == ShapeId(0));
  advance(world);
}

}  // namespace
}  // namespace ringfence::test
