#include "worlds/replay_model.hpp"

#include <map>

#include <doctest/doctest.h>

namespace ringfence::worlds {
namespace {

/// One object that a ReplayModel moves: its input, and its state after each move. Calls the model as a host does.
struct ReplayResult {
  MotionInput input;
  std::uint64_t state = 0;
  bool jumped = false;  ///< in the last frame

  ReplayResult(const ReplayModel& model, ObjectNumber number, bool present) {
    input.number = number;
    input.enabled = present;
    ObjectSpec spec;
    spec.number = number;
    model.start(spec, reinterpret_cast<std::byte*>(&state));
  }
  void move(const ReplayModel& model, std::uint64_t frame) {
    const std::uint64_t before = state;
    input.state = reinterpret_cast<const std::byte*>(&before);
    MotionOutput output{input.pose, input.enabled, reinterpret_cast<std::byte*>(&state), false};
    model.move(frame, {&input, 1}, {&output, 1});
    input.pose = output.pose;
    input.enabled = output.enabled;
    jumped = output.jump;
  }
};

MotionRow at(std::uint32_t frame, ObjectNumber object, double x) {
  return {frame, object, true, false, {{x, 0, 0}, {}}};
}

const Motion motion{7, {at(0, 3, 1), at(0, 5, 50), at(2, 3, 2), {3, 5, false, false, {}}, at(6, 3, 3), at(6, 5, 51)}};

}  // namespace

TEST_CASE("an object takes the pose of each of its rows in the row's frame and keeps it until the next row") {
  const ReplayModel model(motion);
  REQUIRE(model.state_bytes() == sizeof(std::uint64_t));
  ReplayResult three(model, 3, true), five(model, 5, false);
  const double x3[] = {1, 1, 2, 2, 2, 2, 3, 3};
  const bool present5[] = {true, true, true, false, false, false, true, true};
  for (std::uint64_t frame = 0; frame < 8; ++frame) {
    CAPTURE(frame);
    three.move(model, frame);
    five.move(model, frame);
    CHECK(three.input.pose.position.x == x3[frame]);
    CHECK(five.input.enabled == present5[frame]);
    if (five.input.enabled) CHECK(five.input.pose.position.x == (frame < 6 ? 50 : 51));
  }
}

TEST_CASE("an object that was not moved in some frames takes its latest pose") {
  const ReplayModel model(motion);
  ReplayResult three(model, 3, true);
  three.move(model, 0);
  three.move(model, 5);
  CHECK(three.input.pose.position.x == 2);
  three.move(model, 6);
  CHECK(three.input.pose.position.x == 3);
}

TEST_CASE("a row that is a jump is one in the model's output, in its frame only") {
  Motion jumping = motion;
  for (MotionRow& row : jumping.rows) row.jump = row.frame == 2;
  const ReplayModel model(jumping);
  ReplayResult three(model, 3, true), late(model, 3, true), five(model, 5, false);
  for (std::uint64_t frame = 0; frame < 8; ++frame) {
    CAPTURE(frame);
    three.move(model, frame);
    five.move(model, frame);
    CHECK(three.jumped == (frame == 2));
    CHECK(!five.jumped);
  }
  // An object that was not moved in some frames has jumped in one of them.
  late.move(model, 6);
  CHECK(late.jumped);
}

TEST_CASE("an object without rows keeps its pose") {
  const ReplayModel model(motion);
  ReplayResult four(model, 4, true), last(model, 6, false);
  for (std::uint64_t frame = 0; frame < 8; ++frame) {
    four.move(model, frame);
    last.move(model, frame);
  }
  CHECK(four.input.pose == Pose{});
  CHECK(four.input.enabled);
  CHECK(!last.input.enabled);
}

}  // namespace ringfence::worlds
