// World::input: what users pass to the motion model of their avatars.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 11;
constexpr double deadline_ms = 100;

using Bytes = std::vector<std::byte>;
using Received = std::map<std::pair<std::uint64_t, ObjectNumber>, Bytes>;

Bytes bytes_of(std::initializer_list<int> values) {
  Bytes bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

/// BouncingModel, with a list of the inputs that it received, by frame and object.
class RecordingModel final : public BouncingModel {
 public:
  RecordingModel() : BouncingModel(side) {}

  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    BouncingModel::move(frame, inputs, outputs);
    for (const MotionInput& in : inputs) {
      if (!in.input.empty()) {
        const std::lock_guard lock(mutex_);
        ++calls_;
        received_[{frame, in.number}] = Bytes(in.input.begin(), in.input.end());
      }
    }
  }
  Received received() const {
    const std::lock_guard lock(mutex_);
    return received_;
  }
  std::size_t calls() const {
    const std::lock_guard lock(mutex_);
    return calls_;
  }

 private:
  mutable std::mutex mutex_;
  mutable Received received_;
  mutable std::size_t calls_ = 0;  ///< with an input
};

struct Run {
  std::uint64_t digest = 0;
  std::size_t lost = 0;
};

/// 24 frames with 6 users who steer at random; user 5 leaves in frame 15. Checks that the model receives each input
/// once.
Run run(WorldConfig config, const std::multimap<int, Fault>& faults = {}) {
  const auto model = std::make_shared<RecordingModel>();
  config.bounds_max = {side, side, side};
  config.interest = 4;
  config.user_threads = 2;
  config.motion = model;
  World world(config);
  populate(world, 160, 6, side);
  Received expected;
  std::uint64_t random = 99;
  Digest digest;
  Run result;
  for (int frame = 0; frame < 24; ++frame) {
    if (frame == 15) REQUIRE(world.disconnect(UserId(5)) == Status::ok);
    for (std::uint32_t user = 0; user < (frame < 15 ? 6u : 5u); ++user) {
      // populate() gives user i the avatar with number i + 1.
      const ObjectId avatar = world.find(user + 1);
      for (random = random * 6364136223846793005u + 1442695040888963407u; random >> 62 != 0; random <<= 1) {
        Bytes bytes(3 + (random >> 40) % 30);
        for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(random >> (8 + i));
        REQUIRE(world.input(UserId(user), avatar, bytes) == Status::ok);
        expected[{static_cast<std::uint64_t>(frame), user + 1}] = bytes;
      }
    }
    const auto [first, last] = faults.equal_range(frame);
    for (auto at = first; at != last; ++at) {
      Fault fault = at->second;
      fault.frame = static_cast<std::uint64_t>(frame);
      REQUIRE(world.inject(fault) == Status::ok);
    }
    REQUIRE(world.advance() == Status::ok);
    digest.add_frame(world.contacts());
    result.lost += world.report().lost.size();
  }
  result.digest = digest.value();
  REQUIRE(expected.size() > 30);
  REQUIRE((model->received() == expected));
  REQUIRE(model->calls() == expected.size());
  return result;
}

std::uint64_t expected_digest() {
  static const std::uint64_t digest = [] {
    WorldConfig config;
    config.nodes = 0;
    return run(config).digest;
  }();
  return digest;
}

TEST_CASE("inputs of users have the same effect in every deployment, placement and node count") {
  in_all_worlds({}, {0u, 1u, 3u}, [](const WorldConfig& config) { CHECK(run(config).digest == expected_digest()); });
}

TEST_CASE("the model receives each input once and with the same effect when nodes are lost in that frame") {
  WorldConfig config;
  config.nodes = 3;
  config.deadlines.node_ms = deadline_ms;
  const Run ran = run(config, {{4, {NodeId(1), 0, NodeStage::moving, 0}}, {9, {NodeId(0), 0, NodeStage::ending, 0}}});
  CHECK(ran.digest == expected_digest());
  CHECK(ran.lost >= 2);
}

/// Two users with an avatar each, an active object, and a model that stores what it receives.
struct Players {
  explicit Players(WorldConfig config)
      : model(std::make_shared<RecordingModel>()), world([&] {
          config.motion = model;
          return World(std::move(config));
        }()) {
    const ShapeId ball = world.add_shape(Sphere{1});
    alice = world.connect().user;
    bob = world.connect().user;
    avatar = world.spawn({.shape = ball, .category = Category::avatar, .user = alice, .pose = {{5, 5, 5}, {}}}).id;
    other = world.spawn({.shape = ball, .category = Category::avatar, .user = bob, .pose = {{50, 5, 5}, {}}}).id;
    active = world.spawn({.shape = ball, .pose = {{90, 5, 5}, {}}}).id;
  }
  Bytes received(std::uint64_t frame, ObjectId object) const {
    const Received all = model->received();
    const auto at = all.find({frame, object.number()});
    return at == all.end() ? Bytes() : at->second;
  }

  std::shared_ptr<RecordingModel> model;
  World world;
  UserId alice, bob;
  ObjectId avatar, other, active;
};

TEST_CASE("the last input before a frame counts, and an input that is made within a frame is for the next") {
  in_all_worlds({}, {0u, 2u}, [](const WorldConfig& config) {
    Players p(config);
    World& world = p.world;
    CHECK(world.input(p.alice, p.avatar, bytes_of({1})) == Status::ok);  // before its first frame
    CHECK(world.input(p.alice, p.avatar, bytes_of({2, 3})) == Status::ok);
    CHECK(world.input(p.bob, p.other, bytes_of({4})) == Status::ok);
    REQUIRE(world.begin_frame() == Status::ok);
    CHECK(world.input(p.bob, p.other, bytes_of({5})) == Status::ok);
    REQUIRE(world.finish_frame() == Status::ok);
    CHECK(p.received(0, p.avatar) == bytes_of({2, 3}));
    CHECK(p.received(0, p.other) == bytes_of({4}));
    CHECK(world.input(p.alice, p.avatar, bytes_of({6})) == Status::ok);
    CHECK(world.input(p.alice, p.avatar, {}) == Status::ok);  // withdraws it
    REQUIRE(world.advance() == Status::ok);
    CHECK(p.received(1, p.avatar).empty());
    CHECK(p.received(1, p.other) == bytes_of({5}));
    REQUIRE(world.advance() == Status::ok);
    CHECK(p.model->calls() == 3);
  });
}

TEST_CASE("an avatar that its user moves in the same frame stands at that pose, and the model receives the input") {
  in_all_worlds({}, {0u, 2u}, [](const WorldConfig& config) {
    Players p(config);
    CHECK(p.world.input(p.alice, p.avatar, bytes_of({10, 0, 0})) == Status::ok);
    CHECK(p.world.move(p.alice, p.avatar, {{7, 7, 7}, {}}) == Status::ok);
    REQUIRE(p.world.advance() == Status::ok);
    CHECK(p.world.object(p.avatar).spec.pose.position == Vec3d{7, 7, 7});
    CHECK(p.received(0, p.avatar) == bytes_of({10, 0, 0}));
  });
}

TEST_CASE("an input of more than 32 bytes, or for an object that is not an avatar of the user, is refused") {
  in_all_worlds({}, {0u, 2u}, [](const WorldConfig& config) {
    Players p(config);
    World& world = p.world;
    const Bytes longest(32, std::byte{1});
    const Bytes longer(33, std::byte{2});
    CHECK(world.input(p.alice, p.avatar, longest) == Status::ok);
    CHECK(world.input(p.alice, p.avatar, longer) == Status::bad_message);
    CHECK(world.input(p.alice, p.other, longest) == Status::not_host);
    CHECK(world.input(p.alice, p.active, longest) == Status::not_host);
    CHECK(world.input(no_user, p.avatar, longest) == Status::unknown_user);
    CHECK(world.input(UserId(77), p.avatar, longest) == Status::unknown_user);
    CHECK(world.input(p.alice, ObjectId(), longest) == Status::stale_object);
    REQUIRE(world.advance() == Status::ok);
    CHECK(p.received(0, p.avatar) == longest);
    CHECK(p.model->calls() == 1);
    const auto refused = [&](Status reason) { return world.report().refused[static_cast<std::size_t>(reason)]; };
    CHECK(refused(Status::bad_message) == 1);
    CHECK(refused(Status::not_host) == 2);
    CHECK(refused(Status::unknown_user) == 2);
    CHECK(refused(Status::stale_object) == 1);
  });
}

TEST_CASE("inputs for an avatar that is destroyed, or whose user is disconnected, before the frame have no effect") {
  in_all_worlds({}, {0u, 2u}, [](const WorldConfig& config) {
    Players p(config);
    World& world = p.world;
    REQUIRE(world.advance() == Status::ok);
    CHECK(world.input(p.alice, p.avatar, bytes_of({1})) == Status::ok);
    CHECK(world.destroy(p.alice, p.avatar) == Status::ok);
    CHECK(world.input(p.alice, p.avatar, bytes_of({2})) == Status::stale_object);
    CHECK(world.input(p.bob, p.other, bytes_of({3})) == Status::ok);
    CHECK(world.disconnect(p.bob) == Status::ok);
    CHECK(world.input(p.bob, p.other, bytes_of({4})) == Status::unknown_user);
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    CHECK(p.model->calls() == 0);
  });
}

TEST_CASE("without a motion model an input is accepted and has no effect") {
  WorldConfig config;
  config.nodes = 0;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  const UserId user = world.connect().user;
  const ObjectId avatar = world.spawn({.shape = ball, .category = Category::avatar, .user = user}).id;
  CHECK(world.input(user, avatar, bytes_of({1})) == Status::ok);
  REQUIRE(world.advance() == Status::ok);
  CHECK(world.object(avatar).spec.pose == Pose{});
}

}  // namespace
}  // namespace ringfence::test
