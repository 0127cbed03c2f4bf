// User nodes and CD nodes whose threads are still inside a model when the world has replaced them.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <latch>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "ringfence/fault.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr std::uint64_t stall_frame = 3;

/// Makes threads wait until the test opens it. The destructor opens it, so that a test that fails does not wait.
class Barrier {
 public:
  ~Barrier() { open(); }
  void open() {
    if (!std::exchange(opened_, true)) {
      latch_.count_down();
    }
  }
  void wait() const { latch_.wait(); }

 private:
  std::latch latch_{1};
  bool opened_ = false;
};

/// Nothing moves; in one frame the move of some objects does not end until the barrier opens.
class StallingModel : public MotionModel {
 public:
  StallingModel(const Barrier& barrier, std::set<ObjectNumber> objects)
      : barrier_(barrier), objects_(std::move(objects)) {}
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput>) const override {
    const auto stalls = [&](const MotionInput& input) { return objects_.contains(input.number); };
    // Once: the server moves the objects of a lost node itself.
    if (frame == stall_frame && std::any_of(inputs.begin(), inputs.end(), stalls) && stalls_left_.fetch_sub(1) > 0) {
      barrier_.wait();
    }
  }

 private:
  const Barrier& barrier_;
  std::set<ObjectNumber> objects_;
  mutable std::atomic<int> stalls_left_{static_cast<int>(objects_.size())};
};

/// A row of users with one avatar each, in contact with its neighbours. Object i + 1 is the avatar of user i.
struct Row {
  Row(World& in, std::uint32_t users) : world(in), ball(in.add_shape(Sphere{1})) {
    for (std::uint32_t i = 0; i < users; ++i) {
      add();
    }
  }
  void add(UserId number = no_user) {
    const UserId user = world.connect(number).user;
    const double x = 10 + 1.5 * static_cast<double>(avatars.size());
    avatars.push_back(
        world.spawn({.shape = ball, .category = Category::avatar, .user = user, .pose = {{x, 10, 10}, {}}}).id);
    REQUIRE(avatars.back());
  }
  World& world;
  ShapeId ball;
  std::vector<ObjectId> avatars;
};

/// The objects whose states the user node read in the last frame.
std::set<ObjectNumber> seen_by(const World& world, UserId user) {
  std::set<ObjectNumber> numbers;
  for (const auto run : world.seen_by(user)) {
    for (const SeenState& state : run) numbers.insert(state.number);
  }
  return numbers;
}

WorldConfig config_with_user_deadline() {
  WorldConfig config;
  config.nodes = 2;
  config.capacities.users = 2;
  config.timeline = true;
  config.deadlines.user_ms = 400;
  return config;
}

TEST_CASE("a user node whose model does not return affects neither the frames nor the other users of its thread") {
  for (const std::uint32_t threads : {1u, 2u}) {
    CAPTURE(threads);
    Barrier barrier;
    WorldConfig config = config_with_user_deadline();
    config.user_threads = threads;
    config.motion = std::make_shared<StallingModel>(barrier, std::set<ObjectNumber>{2});
    World world(config);
    const struct Opening {
      Barrier& barrier;
      ~Opening() { barrier.open(); }
    } opening{barrier};
    Row row(world, 4);
    for (std::uint64_t frame = 0; frame < stall_frame; ++frame) {
      advance(world);
    }
    REQUIRE(world.collisions_of(UserId(1)).size() == 2);
    REQUIRE(world.advance() == Status::ok);
    CHECK(world.report().late == std::vector<UserId>{UserId(1)});
    CHECK(refused(world, Status::late) == 1);
    CHECK(world.contacts().size() == 3);  // with the old pose of the late avatar
    CHECK(world.collisions_of(UserId(0)).size() == 1);
    CHECK(world.collisions_of(UserId(2)).size() == 2);
    CHECK(world.collisions_of(UserId(3)).size() == 1);
    CHECK(world.collisions_of(UserId(1)).empty());
    CHECK(world.seen_by(UserId(1)).empty());
    CHECK(seen_by(world, UserId(0)) == std::set<ObjectNumber>{3, 4});
    CHECK(seen_by(world, UserId(3)) == std::set<ObjectNumber>{1, 3});
    CHECK(refused(world, Status::bad_message) == 0);
    // Its thread is still inside the model.
    row.add(UserId(700));
    REQUIRE(world.move(UserId(0), row.avatars[0], {{30, 10, 10}, {}}) == Status::ok);
    advance(world);
    CHECK(world.report().late.empty());
    CHECK(world.object(row.avatars[0]).spec.pose.position.x == 30);
    CHECK(world.object(row.avatars[1]).id == ObjectId{});
    CHECK(world.contacts().size() == 2);
    CHECK(world.ended().size() == 2);
    CHECK(world.collisions_of(UserId(1)).empty());
    CHECK(world.collisions_of(UserId(700)).size() == 1);
    REQUIRE(world.connect(UserId(1)).status == Status::ok);
    for (int frame = 0; frame < 4; ++frame) {
      advance(world);
    }
    barrier.open();
    for (int frame = 0; frame < 20; ++frame) {
      advance(world);
    }
    CHECK(world.contacts().size() == 2);
  }
}

TEST_CASE("user nodes of one thread that stall in the same frame are late one after another, and the others are not") {
  Barrier barrier;
  WorldConfig config = config_with_user_deadline();
  config.motion = std::make_shared<StallingModel>(barrier, std::set<ObjectNumber>{1, 3, 4});
  World world(config);
  const struct Opening {
    Barrier& barrier;
    ~Opening() { barrier.open(); }
  } opening{barrier};
  const Row row(world, 5);
  for (std::uint64_t frame = 0; frame < stall_frame; ++frame) {
    advance(world);
  }
  REQUIRE(world.advance() == Status::ok);
  std::vector<UserId> late = world.report().late;
  std::sort(late.begin(), late.end());
  CHECK(late == std::vector<UserId>{UserId(0), UserId(2), UserId(3)});
  CHECK(seen_by(world, UserId(1)) == std::set<ObjectNumber>{5});
  CHECK(seen_by(world, UserId(4)) == std::set<ObjectNumber>{2});
  CHECK(refused(world, Status::bad_message) == 0);
  CHECK(world.collisions_of(UserId(1)).size() == 2);
  CHECK(world.collisions_of(UserId(4)).size() == 1);
  advance(world);
  CHECK(world.contacts().empty());
  CHECK(world.ended().size() == 4);
  CHECK(world.report().users_cpu_ms >= 0);
  // The world is destroyed before their models return, and waits for them.
  barrier.open();
}

TEST_CASE("a user node that a fault stops inside its model or its publication is late, and the others are not") {
  for (const NodeStage stage : {NodeStage::model, NodeStage::publication}) {
    CAPTURE(name_of(stage));
    const Barrier barrier;
    WorldConfig config = config_with_user_deadline();
    config.motion = std::make_shared<StallingModel>(barrier, std::set<ObjectNumber>{});
    World world(config);
    const Row row(world, 3);
    advance(world);
    advance(world);
    Fault fault;
    fault.frame = world.frames();
    fault.stage = stage;
    fault.user = UserId(1);
    REQUIRE(world.inject(fault) == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    CHECK(world.report().late == std::vector<UserId>{UserId(1)});
    CHECK(refused(world, Status::late) == 1);
    CHECK(world.contacts().size() == 2);  // with the old pose of the late avatar
    CHECK(world.collisions_of(UserId(0)).size() == 1);
    CHECK(world.collisions_of(UserId(1)).empty());
    CHECK(world.collisions_of(UserId(2)).size() == 1);
    // Its thread is still stopped, so another fault cannot be injected.
    ++fault.frame;
    CHECK(world.inject(fault) == Status::bad_number);
    REQUIRE(world.advance() == Status::ok);
    CHECK(world.report().late.empty());
    CHECK(world.contacts().empty());
    CHECK(world.ended().size() == 2);
    REQUIRE(world.connect(UserId(1)).status == Status::ok);
    advance(world);
    if (stage == NodeStage::model) {
      CHECK(world.release_faults() == 1);
      advance(world);
    }
    // Otherwise the destructor releases it.
  }
}

/// The support function of a ball. Once it is armed, the next call waits until the barrier opens.
class SlowBall : public SupportFunction {
 public:
  explicit SlowBall(const Barrier& barrier) : barrier_(barrier) {}
  Vec3f support(Vec3f direction) const override {
    if (armed.exchange(false)) {
      barrier_.wait();
    }
    const float length = std::sqrt(direction.x * direction.x + direction.y * direction.y + direction.z * direction.z);
    return length == 0 ? Vec3f{1, 0, 0} : Vec3f{direction.x / length, direction.y / length, direction.z / length};
  }
  mutable std::atomic<bool> armed{false};

 private:
  const Barrier& barrier_;
};

/// All objects move a little, so that their bounds are computed in each frame. In the stall frame the host of object 1
/// arms the support function.
class TremblingModel : public MotionModel {
 public:
  explicit TremblingModel(std::shared_ptr<const SlowBall> ball) : ball_(std::move(ball)) {}
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      outputs[i].pose.position.x += frame % 2 == 0 ? 0.25 : -0.25;
      if (frame == stall_frame && inputs[i].number == 1 && !stalled_.exchange(true)) {
        ball_->armed = true;
      }
    }
  }

 private:
  std::shared_ptr<const SlowBall> ball_;
  mutable std::atomic<bool> stalled_{false};
};

WorldConfig config_with_node_deadline() {
  WorldConfig config;
  config.nodes = 3;
  config.tuning.cells_log2[0] = 2;
  config.tuning.cells_log2[1] = config.tuning.cells_log2[2] = 1;
  config.timeline = true;
  config.deadlines.node_ms = 100;
  return config;
}

TEST_CASE("shapes can be added while a lost node still reads one") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    CAPTURE(name_of(placement));
    Barrier barrier;
    const auto ball = std::make_shared<SlowBall>(barrier);
    WorldConfig config = config_with_node_deadline();
    config.placement = placement;
    config.motion = std::make_shared<TremblingModel>(ball);
    World world(config);
    const struct Opening {
      Barrier& barrier;
      ~Opening() { barrier.open(); }
    } opening{barrier};
    const ShapeId slow = world.add_shape(SupportShape{ball});
    const ShapeId box = world.add_shape(Box{{1, 1, 1}});
    for (int i = 0; i < 8; ++i) {
      const double x = 12.5 * i;
      REQUIRE(world.spawn({.shape = i == 0 ? slow : box, .pose = {{x, 10, 10}, {}}}).status == Status::ok);
      REQUIRE(world.spawn({.shape = i == 0 ? box : slow, .pose = {{x + 1.5, 10, 10}, {}}}).status == Status::ok);
    }
    for (std::uint64_t frame = 0; frame < stall_frame; ++frame) {
      REQUIRE(world.advance() == Status::ok);
    }
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(!world.report().lost.empty());
    const std::size_t contacts = world.contacts().size();
    CHECK(contacts == 8);
    for (int i = 0; i < 200; ++i) {
      const float size = 1 + 0.01f * static_cast<float>(i);
      world.add_shape(Sphere{size});
      world.add_shape(SupportShape{ball});
      world.add_shape(ConvexHull{{{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}}});
      world.add_shape(TriangleMesh{{{0, 0, 0}, {size, 0, 0}, {0, size, 0}}, {{0, 1, 2}}});
    }
    barrier.open();
    for (int frame = 0; frame < 10; ++frame) {
      world.add_shape(Sphere{1});
      REQUIRE(world.advance() == Status::ok);
      CHECK(world.contacts().size() == contacts);
    }
  }
}

TEST_CASE("the timeline has the tracks of the nodes of its frame, and none of a lost node") {
  Barrier barrier;
  WorldConfig config = config_with_node_deadline();
  config.motion = std::make_shared<StallingModel>(barrier, std::set<ObjectNumber>{1});
  World world(config);
  const struct Opening {
    Barrier& barrier;
    ~Opening() { barrier.open(); }
  } opening{barrier};
  const ShapeId ball = world.add_shape(Sphere{1});
  REQUIRE(world.connect().status == Status::ok);
  for (int i = 0; i < 8; ++i) {
    REQUIRE(world.spawn({.shape = ball, .pose = {{12.5 * i, 10, 10}, {}}}).status == Status::ok);
  }
  const auto require_tracks = [&] {
    const auto& timeline = world.report().timeline;
    const auto nodes = static_cast<std::uint32_t>(world.report().nodes.size());
    std::set<std::uint32_t> with_spans;
    for (const TimelineSpan& span : timeline) {
      with_spans.insert(span.track);
    }
    for (std::uint32_t node = 0; node < nodes; ++node) {
      const NodeId id = world.report().nodes[node].id;
      const bool lost = std::count(world.report().lost.begin(), world.report().lost.end(), id) != 0;
      CAPTURE(node);
      REQUIRE(with_spans.contains(1 + node) == !lost);
    }
    REQUIRE(with_spans.contains(1 + nodes));  // the user thread
    REQUIRE(*with_spans.rbegin() == 1 + nodes);
  };
  for (std::uint64_t frame = 0; frame < stall_frame; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    require_tracks();
  }
  REQUIRE(world.advance() == Status::ok);
  REQUIRE(!world.report().lost.empty());
  require_tracks();
  REQUIRE(world.advance() == Status::ok);
  require_tracks();
  barrier.open();
  for (int frame = 0; frame < 20; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    require_tracks();
  }
  REQUIRE(world.resize(4) == Status::ok);
  for (int frame = 0; frame < 4; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    require_tracks();
  }
}

}  // namespace
}  // namespace ringfence::test
