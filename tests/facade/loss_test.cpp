// What happens to a world when CD nodes are lost or a user node is late.
#include <algorithm>
#include <atomic>
#include <initializer_list>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <string_view>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/views.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 14;
constexpr int frames = 24;

struct LossRun {
  std::uint64_t digest = 0;
  std::size_t lost = 0;
  std::uint32_t nodes = 0;
  std::uint64_t late = 0;
  std::uint64_t refused = 0;  ///< refused calls and records, for any reason
  std::size_t logged = 0;
  std::uint32_t stopped = 0;  ///< roles that are still stopped within a step at the end
};

/// Ids of the nodes before the next frame, unless nodes have left in the last one. `next_id` is the id of the next
/// node.
std::vector<std::uint32_t> ids_of(const World& world, std::uint32_t next_id) {
  std::vector<std::uint32_t> ids;
  for (std::uint32_t id = 0; world.frames() == 0 && id < world.nodes(); ++id) {
    ids.push_back(id);
  }
  const FrameReport& report = world.report();
  for (const NodeReport& node : report.nodes) {
    if (std::count(report.lost.begin(), report.lost.end(), node.id) == 0) {
      ids.push_back(node.id.number());
    }
  }
  return ids.empty() ? std::vector<std::uint32_t>{next_id} : ids;
}

/// Runs a world for `frames` frames. `faults` and `resizes` (numbers of CD nodes) are sorted by their frame.
LossRun run(WorldConfig config, const std::multimap<int, Fault>& faults,
            const std::map<int, std::uint32_t>& resizes = {}) {
  config.bounds_max = {side, side, side};
  config.interest = 4;
  config.motion = std::make_shared<BouncingModel>(side);
  config.user_threads = 1;
  LossRun ran;
  config.log = [&](LogLevel level, std::string_view) { ran.logged += level == LogLevel::error ? 1 : 0; };
  World world(config);
  populate(world, 200, 4, side);
  Digest digest;
  std::uint32_t next_id = 0;
  for (int frame = 0; frame < frames; ++frame) {
    CAPTURE(frame);
    const auto [first, last] = faults.equal_range(frame);
    for (auto at = first; at != last; ++at) {
      Fault fault = at->second;
      fault.frame = static_cast<std::uint64_t>(frame);
      // Faults name nodes by their position. On a busy machine more nodes may be lost than were stopped by the test.
      const std::vector<std::uint32_t> ids = ids_of(world, next_id);
      fault.node = NodeId(ids[fault.node.number() < ids.size() ? fault.node.number() : 0]);
      const Status status = world.inject(fault);
      // A node that the server's thread steps, because all others were lost, cannot stop within a step.
      const bool inside = static_cast<std::size_t>(fault.stage) >= boundary_stage_count;
      REQUIRE((status == Status::ok || (inside && status == Status::bad_number)));
    }
    if (const auto at = resizes.find(frame); at != resizes.end()) {
      REQUIRE(world.resize(at->second) == Status::ok);
    }
    REQUIRE(world.advance() == Status::ok);
    const FrameReport& report = world.report();
    REQUIRE(report.accepted == report.candidates);
    for (const NodeReport& node : report.nodes) {
      next_id = std::max(next_id, node.id.number() + 1);
    }
    require_views(world, first_users(4));
    ran.lost += report.lost.size();
    ran.nodes = world.nodes();
    ran.late += report.refused[static_cast<std::size_t>(Status::late)];
    ran.refused = std::accumulate(report.refused.begin(), report.refused.end(), ran.refused);
    digest.add_frame(world.contacts());
  }
  ran.digest = digest.value();
  ran.stopped = world.release_faults();
  return ran;
}

std::uint64_t expected() {
  WorldConfig config;
  config.nodes = 0;
  static const std::uint64_t digest = run(config, {}).digest;
  return digest;
}

// Longer than a frame takes here. If a busy machine delays a node for longer, counts change, but contacts do not.
constexpr double deadline_ms = 60;

TEST_CASE("nodes that stop at any stage, one after another until none is left, change no contact") {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      CAPTURE(name_of(deployment));
      CAPTURE(name_of(placement));
      WorldConfig config;
      config.deployment = deployment;
      config.placement = placement;
      config.nodes = 7;
      config.deadlines.node_ms = deadline_ms;
      std::multimap<int, Fault> faults;
      for (std::size_t stage = 0; stage < boundary_stage_count; ++stage) {
        faults.insert(
            {static_cast<int>(3 * stage + 2),
             {NodeId(static_cast<std::uint32_t>((stage * 3) % (7 - stage))), 0, static_cast<NodeStage>(stage), 0}});
      }
      const LossRun ran = run(config, faults);
      CHECK(ran.digest == expected());
      CHECK(ran.lost >= 6);  // a node without hand-overs does not pass every stage
      CHECK(ran.logged == ran.lost);
      CHECK(ran.nodes >= 1);
    }
  }
}

/// Two nodes stop at `stage` in some frames. A node that hands nothing over does not reach NodeStage::hand_over.
LossRun run_stopped_inside(WorldConfig config, NodeStage stage, double stall_ms, std::uint32_t passes) {
  config.nodes = 6;  // with 4 nodes or fewer the server may publish their states
  config.deadlines.node_ms = deadline_ms;
  std::multimap<int, Fault> faults;
  const int frames_apart = stage == NodeStage::hand_over ? 1 : 5;
  for (int frame = 3; frame <= 13; frame += frames_apart) {
    faults.insert({frame, {NodeId(0), 0, stage, stall_ms, no_user, passes}});
    faults.insert({frame, {NodeId(1), 0, stage, stall_ms, no_user, passes}});
  }
  return run(config, faults);
}

TEST_CASE("a node that stops inside a model, a kernel, a hand-over or a publication changes no contact") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    for (const NodeStage stage : {NodeStage::model, NodeStage::kernel, NodeStage::hand_over, NodeStage::publication}) {
      for (const std::uint32_t passes : {0u, 1u}) {
        if (passes == 1 && stage == NodeStage::publication) continue;  // a node publishes once per frame
        CAPTURE(name_of(placement));
        CAPTURE(name_of(stage));
        CAPTURE(passes);
        WorldConfig config;
        config.placement = placement;
        // The stopped node continues at the end, when the others have changed the memory that it uses.
        const LossRun stopped = run_stopped_inside(config, stage, 0, passes);
        CHECK(stopped.digest == expected());
        CHECK(stopped.lost >= stopped.stopped);
        CHECK((stopped.stopped >= 1 || passes == 1));
        // The stopped node continues while the others run.
        const LossRun late = run_stopped_inside(config, stage, 2 * deadline_ms, passes);
        CHECK(late.digest == expected());
      }
    }
  }
}

TEST_CASE("of many nodes, one that has to wake others and stops changes no contact") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    const bool on_server = placement == Placement::server;
    for (const NodeStage stage :
         {on_server ? NodeStage::moving : NodeStage::ending, on_server ? NodeStage::model : NodeStage::gate}) {
      CAPTURE(name_of(placement));
      CAPTURE(name_of(stage));
      WorldConfig config;
      config.placement = placement;
      config.nodes = 40;  // the first eight wake the others
      config.deadlines.node_ms = 4 * deadline_ms;
      const LossRun ran = run(config, {{4, {NodeId(0), 0, stage, 0}}, {9, {NodeId(3), 0, stage, 0}}}, {{14, 20}});
      CHECK(ran.digest == expected());
      CHECK(ran.nodes == 20);
    }
  }
}

TEST_CASE("a node that stops inside a kernel changes no contact in any deployment") {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server}) {
    WorldConfig config;
    config.deployment = deployment;
    CAPTURE(name_of(deployment));
    const LossRun ran = run_stopped_inside(config, NodeStage::kernel, 0, 0);
    CHECK(ran.digest == expected());
    CHECK(ran.stopped >= 1);
  }
}

TEST_CASE("a node that stops inside a read gate for longer than its deadline changes no contact") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    for (const std::uint32_t passes : {0u, 1u}) {
      CAPTURE(name_of(placement));
      CAPTURE(passes);
      WorldConfig config;
      config.placement = placement;
      const LossRun ran = run_stopped_inside(config, NodeStage::gate, 2 * deadline_ms, passes);
      CHECK(ran.digest == expected());
    }
  }
}

TEST_CASE("a World can be destroyed while roles are stopped, even without deadlines and with a running frame") {
  for (const NodeStage stage : {NodeStage::moving, NodeStage::model, NodeStage::kernel, NodeStage::publication}) {
    CAPTURE(name_of(stage));
    WorldConfig config;
    config.nodes = 2;
    config.bounds_max = {side, side, side};
    config.motion = std::make_shared<BouncingModel>(side);
    World world(config);
    populate(world, 100, 4, side);
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(world.inject({NodeId(1), 1, stage, 0}) == Status::ok);
    if (stage == NodeStage::model || stage == NodeStage::publication) {
      REQUIRE(world.inject({NodeId(0), 1, stage, 0, UserId(2)}) == Status::ok);
    }
    REQUIRE(world.begin_frame() == Status::ok);
  }
}

TEST_CASE("a role that is stopped without a deadline continues when it is released, and the frame completes") {
  WorldConfig config;
  config.nodes = 2;
  config.bounds_max = {side, side, side};
  config.motion = std::make_shared<BouncingModel>(side);
  World world(config);
  populate(world, 100, 4, side);
  REQUIRE(world.advance() == Status::ok);
  std::uint64_t frame = 1;
  for (const NodeStage stage : {NodeStage::moving, NodeStage::ending, NodeStage::model, NodeStage::publication}) {
    CAPTURE(name_of(stage));
    REQUIRE(world.inject({NodeId(1), frame, stage, 0}) == Status::ok);
    REQUIRE(world.begin_frame() == Status::ok);
    world.release_faults();
    REQUIRE(world.finish_frame() == Status::ok);
    REQUIRE(world.report().lost.empty());
    REQUIRE(world.report().accepted == world.report().candidates);
    ++frame;
  }
}

TEST_CASE("nodes that are lost in the same frame, also all of them, change no contact") {
  for (const NodeStage stage : {NodeStage::moving, NodeStage::colliding, NodeStage::ending}) {
    WorldConfig config;
    config.nodes = 3;
    config.deadlines.node_ms = deadline_ms;
    CAPTURE(name_of(stage));
    const LossRun two = run(config, {{5, {NodeId(0), 0, stage, 0}}, {5, {NodeId(2), 0, NodeStage::gathering, 0}}});
    CHECK(two.digest == expected());
    CHECK(two.lost >= 2);
    const LossRun all =
        run(config, {{5, {NodeId(0), 0, stage, 0}}, {5, {NodeId(1), 0, stage, 0}}, {5, {NodeId(2), 0, stage, 0}}});
    CHECK(all.digest == expected());
    CHECK(all.lost >= 3);
    CHECK(all.nodes == 1);
  }
}

TEST_CASE("messages of a lost node that wakes up are refused as late") {
  WorldConfig config;
  config.nodes = 3;
  config.deadlines.node_ms = deadline_ms;
  // Another node is lost later in the same frame, so that the first one wakes before the frame ends.
  const LossRun ran =
      run(config, {{5, {NodeId(1), 0, NodeStage::moving, 4 * deadline_ms}}, {5, {NodeId(2), 0, NodeStage::ending, 0}}});
  CHECK(ran.digest == expected());
  CHECK(ran.lost >= 2);
}

TEST_CASE("a lost node that wakes up in a later frame does not change memory that the other nodes use") {
  WorldConfig config;
  config.nodes = 4;
  config.deadlines.node_ms = deadline_ms;
  for (const std::uint32_t first : {0u, 3u}) {
    CAPTURE(first);
    // A later loss keeps the world running until the first node wakes.
    const LossRun ran = run(config, {{5, {NodeId(first), 0, NodeStage::ending, 2 * deadline_ms}},
                                     {8, {NodeId(1), 0, NodeStage::colliding, 0}}});
    CHECK(ran.digest == expected());
    CHECK(ran.lost >= 2);
  }
}

TEST_CASE("losses and resizes in any order change no contact") {
  WorldConfig config;
  config.nodes = 4;
  config.deadlines.node_ms = deadline_ms;
  const LossRun ran = run(config,
                          {{3, {NodeId(1), 0, NodeStage::colliding, 0}},  // while two nodes join
                           {8, {NodeId(4), 0, NodeStage::ending, 0}},  // the last number, while two nodes are to leave
                           {12, {NodeId(0), 0, NodeStage::moving, 0}},
                           {16, {NodeId(0), 0, NodeStage::reporting, 0}}},
                          {{3, 6}, {8, 3}, {13, 5}, {17, 1}, {20, 4}});
  CHECK(ran.digest == expected());
  CHECK(ran.lost >= 3);
}

TEST_CASE(
    "when all remaining nodes are lost while the others leave, the first leaving node stays, and the world can grow") {
  for (const std::uint32_t staying : {1u, 2u}) {
    for (const NodeStage stage : {NodeStage::ending, NodeStage::settling, NodeStage::reporting}) {
      for (const std::uint32_t next : {2u, 3u, 6u}) {
        CAPTURE(staying);
        CAPTURE(name_of(stage));
        CAPTURE(next);
        WorldConfig config;
        config.nodes = 5;
        config.deadlines.node_ms = deadline_ms;
        std::multimap<int, Fault> faults;
        for (std::uint32_t node = 0; node < staying; ++node) {
          faults.insert({4, {NodeId(node), 0, stage, 0}});
        }
        const LossRun ran = run(config, faults, {{4, staying}, {5, next}, {8, 4}});
        CHECK(ran.digest == expected());
        CHECK(ran.refused == ran.late);
        CHECK(ran.lost >= staying);
        if (ran.lost == staying) {
          CHECK(ran.nodes == 4);
        }
      }
    }
  }
}

/// A world in which nodes are lost at will, beside one with a single thread, whose contacts it must have.
struct SlotWorld {
  explicit SlotWorld(std::uint32_t nodes, Placement placement = Placement::region) {
    WorldConfig config;
    config.placement = placement;
    config.bounds_max = {side, side, side};
    config.motion = std::make_shared<BouncingModel>(side);
    config.nodes = 0;
    alone.emplace(config);
    config.nodes = nodes;
    config.deadlines.node_ms = 4 * deadline_ms;  // exactly the stopped nodes are lost
    world.emplace(config);
    populate(*alone, 200, 4, side);
    populate(*world, 200, 4, side);
  }
  void lose(std::initializer_list<std::uint32_t> ids, NodeStage stage) {
    for (const std::uint32_t id : ids) {
      REQUIRE(world->inject({NodeId(id), world->frames(), stage, 0}) == Status::ok);
    }
    advance();
    REQUIRE(world->report().lost.size() == ids.size());
    for (const std::uint32_t id : ids) {
      REQUIRE(std::count(world->report().lost.begin(), world->report().lost.end(), NodeId(id)) == 1);
    }
  }
  void advance() {
    REQUIRE(alone->advance() == Status::ok);
    REQUIRE(world->advance() == Status::ok);
    Digest expected, found;
    expected.add_frame(alone->contacts());
    found.add_frame(world->contacts());
    REQUIRE(found.value() == expected.value());
    const FrameReport& report = world->report();
    REQUIRE(report.accepted == report.candidates);
    std::uint64_t tested = 0;
    for (const NodeReport& node : report.nodes) tested += node.tested + node.carried;
    REQUIRE(tested == report.candidates);
  }
  std::vector<std::uint32_t> ids() const {
    std::vector<std::uint32_t> all;
    for (const NodeReport& node : world->report().nodes) all.push_back(node.id.number());
    return all;
  }
  std::optional<World> alone, world;
};

using Ids = std::vector<std::uint32_t>;

TEST_CASE("a node keeps its id when others are lost, and a later node takes the place but not the id of a lost one") {
  for (const NodeStage stage : {NodeStage::moving, NodeStage::colliding, NodeStage::ending, NodeStage::reporting}) {
    CAPTURE(name_of(stage));
    SlotWorld slots(4);
    slots.advance();
    CHECK(slots.ids() == Ids{0, 1, 2, 3});
    slots.lose({1}, stage);
    CHECK(slots.ids() == Ids{0, 1, 2, 3});  // it is a node of this frame
    slots.advance();
    CHECK(slots.ids() == Ids{0, 2, 3});
    REQUIRE(slots.world->resize(5) == Status::ok);
    slots.advance();
    CHECK(slots.ids() == Ids{0, 4, 2, 3, 5});
    slots.advance();
    // The new nodes work, too.
    for (const NodeReport& node : slots.world->report().nodes) CHECK(node.hosted > 0);
    slots.lose({4}, stage);
    slots.advance();
    CHECK(slots.ids() == Ids{0, 2, 3, 5});
    CHECK(slots.world->inject({NodeId(4), slots.world->frames(), stage, 0}) == Status::bad_number);
  }
}

TEST_CASE("a smaller world keeps the oldest nodes, wherever they stand") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    CAPTURE(name_of(placement));
    SlotWorld slots(4, placement);
    slots.advance();
    slots.lose({0, 2}, NodeStage::moving);
    REQUIRE(slots.world->resize(4) == Status::ok);
    slots.advance();
    CHECK(slots.ids() == Ids{4, 1, 5, 3});
    REQUIRE(slots.world->resize(2) == Status::ok);
    slots.advance();
    CHECK(slots.ids() == Ids{4, 1, 5, 3});  // they hand everything over
    slots.advance();
    CHECK(slots.ids() == Ids{1, 3});
    REQUIRE(slots.world->resize(1) == Status::ok);
    slots.advance();
    slots.advance();
    CHECK(slots.ids() == Ids{1});  // alone, but not in the first place
    for (int frame = 0; frame < 3; ++frame) {
      slots.advance();
      CHECK(slots.world->report().nodes[0].tested == slots.world->report().candidates);
    }
    REQUIRE(slots.world->resize(3) == Status::ok);
    slots.advance();
    slots.advance();
    CHECK(slots.ids() == Ids{6, 1, 7});
  }
}

TEST_CASE("if a node is lost in the frame in which others are to leave, these leave in the next one") {
  SlotWorld slots(5);
  slots.advance();
  REQUIRE(slots.world->resize(2) == Status::ok);
  slots.lose({0}, NodeStage::colliding);
  slots.advance();
  CHECK(slots.ids() == Ids{1, 2, 3, 4});
  slots.advance();
  CHECK(slots.ids() == Ids{1, 2});
}

TEST_CASE("a fallback node has an id of its own, and its place is that of the last node") {
  SlotWorld slots(2);
  slots.advance();
  slots.lose({0}, NodeStage::moving);
  slots.lose({1}, NodeStage::colliding);
  CHECK(slots.ids() == Ids{2});
  slots.advance();
  CHECK(slots.ids() == Ids{2});
  REQUIRE(slots.world->resize(2) == Status::ok);
  slots.advance();
  CHECK(slots.ids() == Ids{3, 2});
}

TEST_CASE("a deadline that no node misses changes nothing") {
  WorldConfig config;
  config.nodes = 3;
  config.deadlines = {20'000, 20'000};
  const LossRun ran = run(config, {});
  CHECK(ran.digest == expected());
  CHECK(ran.lost == 0);
  CHECK(ran.late == 0);
}

/// No object moves. In frame 3 the move of object 2 waits until the test sets `may_go`.
class StallingModel : public MotionModel {
 public:
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput>) const override {
    for (const MotionInput& input : inputs) {
      while (input.number == 2 && frame == 3 && !may_go.load()) {
        std::this_thread::yield();
      }
    }
  }
  mutable std::atomic<bool> may_go{false};
};

TEST_CASE("a user node that misses its deadline is disconnected, its contacts end, and the others go on") {
  const auto model = std::make_shared<StallingModel>();
  WorldConfig config;
  config.nodes = 2;
  config.user_threads = 2;
  config.motion = model;
  config.deadlines.user_ms = 10 * deadline_ms;  // the other user must meet it even on a busy machine
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  const UserId first = world.connect().user;
  const UserId second = world.connect().user;
  const auto avatar = [&](UserId user, double x) {
    return world.spawn({.shape = ball, .category = Category::avatar, .user = user, .pose = {{x, 0, 0}, {}}}).id;
  };
  const ObjectId one = avatar(first, 10);
  const ObjectId two = avatar(second, 11.5);
  for (int frame = 0; frame < 3; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(world.contacts().size() == 1);
  }
  REQUIRE(world.advance() == Status::ok);  // the frame completes without the stalled user
  CHECK(world.report().late == std::vector<UserId>{second});
  CHECK(world.report().refused[static_cast<std::size_t>(Status::late)] == 1);
  CHECK(world.contacts().size() == 1);  // the late user's avatar is at its old pose
  CHECK(world.collisions_of(first).size() == 1);
  model->may_go = true;
  REQUIRE(world.advance() == Status::ok);
  CHECK(world.report().late.empty());
  CHECK(world.contacts().empty());
  REQUIRE(world.ended().size() == 1);
  CHECK(world.ended()[0].b == two.number());
  CHECK(world.object(two).id == ObjectId{});
  CHECK(world.object(one).id == one);
  CHECK(world.move(second, two, {}) == Status::unknown_user);
  CHECK(world.connect(second).status == Status::ok);  // the number is free again
  CHECK(world.advance() == Status::ok);
}

TEST_CASE("an impossible fault is refused") {
  WorldConfig config;
  config.nodes = 2;
  World world(config);
  CHECK(world.inject({NodeId(2), 0, NodeStage::moving, 0}) == Status::bad_number);
  CHECK(world.inject({NodeId(0), 0, NodeStage::moving, -1}) == Status::bad_number);
  CHECK(world.inject({NodeId(0), 0, static_cast<NodeStage>(node_stage_count), 0}) == Status::bad_number);
  CHECK(world.inject({NodeId(0), 0, NodeStage::model, 0, UserId(0)}) == Status::bad_number);  // unknown user
  REQUIRE(world.connect(UserId(0)).status == Status::ok);
  CHECK(world.advance() == Status::ok);
  CHECK(world.inject({NodeId(0), 5, NodeStage::kernel, 0, UserId(0)}) == Status::bad_number);
  CHECK(world.inject({NodeId(0), 5, NodeStage::moving, 0, UserId(0)}) == Status::bad_number);
  CHECK(world.inject({NodeId(0), 5, NodeStage::publication, 0, UserId(0)}) == Status::ok);
  CHECK(world.inject({NodeId(0), 0, NodeStage::moving, 0}) == Status::bad_number);
  CHECK(world.begin_frame() == Status::ok);
  CHECK(world.inject({NodeId(0), 5, NodeStage::moving, 0}) == Status::out_of_order);
  CHECK(world.finish_frame() == Status::ok);
  config.nodes = 0;
  World alone(config);
  CHECK(alone.inject({NodeId(0), 0, NodeStage::moving, 0}) == Status::bad_number);
}

}  // namespace
}  // namespace ringfence::test
