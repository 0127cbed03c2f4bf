// Host-owned states of a CD node: which states are reported, and which the server reads after a loss.
#include "nodes/exchange/host_owned_states.hpp"

#include <array>
#include <cstring>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {
namespace {

/// One object on a line; its positions come from a table, and its state is its position.
class ScriptedModel : public MotionModel {
 public:
  explicit ScriptedModel(std::vector<double> places, bool has_state = true)
      : places_(std::move(places)), has_state_(has_state) {}
  double place(std::size_t frame) const { return places_[frame]; }
  std::size_t state_bytes() const noexcept override { return has_state_ ? 8 : 0; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      outputs[i].pose.position.x = places_[frame];
      if (has_state_) std::memcpy(outputs[i].state, &places_[frame], sizeof(double));
    }
  }

 private:
  std::vector<double> places_;
  bool has_state_;
};

HarnessConfig stage(const MotionModel& model) {
  HarnessConfig config;
  config.placement = Placement::region;
  config.shares_memory = true;
  config.nodes = 2;
  config.grid = {{2, 0, 0}};  // cells of 16 m, two per node
  config.model = &model;
  return config;
}

ObjectSpec ball_at(TestHarness& harness, double x) {
  ObjectSpec spec;
  spec.shape = harness.add_shape(Sphere{1});
  spec.pose.position = {x, 8, 8};
  return spec;
}

/// Flags of the states that were reported in the last frame.
std::vector<std::uint32_t> reported(const TestHarness& harness) {
  std::vector<std::uint32_t> flags;
  for (const LoggedMessage& seen : harness.log()) {
    for (std::size_t i = 0; seen.type() == MessageType::node_state && i < seen.header.count; ++i) {
      flags.push_back(seen.record<messages::NodeStateRecord>(i).object.flags);
    }
  }
  return flags;
}

constexpr std::uint32_t at_home = messages::flag_present | messages::flag_interior | messages::flag_keeps_host;

TEST_CASE("a node reports an object to the server when it arrives, comes to rest and leaves, and not otherwise") {
  // The border is at 32.
  const std::vector<double> places = {4, 5, 6, 6, 6, 7, 8, 9, 31.5, 31, 30, 29, 33.5, 40, 41};
  const std::vector<std::vector<std::uint32_t>> expected = {
      {at_home | messages::flag_host_owned},
      {},
      {},
      {at_home | messages::flag_at_rest},
      {},
      {at_home | messages::flag_host_owned},
      {},
      {},
      {},  // near the border its peer receives ghost updates, see ghost_updates_test
      {},
      {},
      {},
      {messages::flag_present | messages::flag_host_owned},
      {},
      {},
  };
  const ScriptedModel model(places);
  TestHarness harness(stage(model));
  const ObjectId id = harness.spawn(ball_at(harness, 3));
  for (std::size_t frame = 0; frame < places.size(); ++frame) {
    CAPTURE(frame);
    harness.frame();
    CHECK(reported(harness) == expected[frame]);
    CHECK(harness.server().pose(harness.table().find(id.number())).position.x == places[frame]);
    CHECK(harness.report().moved == (frame > 0 && places[frame] == places[frame - 1] ? 0 : 1));
    harness.require_one_host_each();
  }
}

/// Where no node may be lost, moves an object as the model says, and checks where it is and that only the first frame
/// reports it, so many times.
void follow_without_losses(const ScriptedModel& model, std::size_t frames, std::size_t reported_first) {
  HarnessConfig config = stage(model);
  config.nodes_may_be_lost = false;
  TestHarness harness(config);
  const ObjectId id = harness.spawn(ball_at(harness, 3));
  const auto host_at = [](double x) { return Endpoint::node(x > 32 ? 1 : 0); };
  for (std::size_t frame = 0; frame < frames; ++frame) {
    CAPTURE(frame);
    harness.frame();
    const double x = model.place(frame), before = frame == 0 ? 3 : model.place(frame - 1);
    const std::uint32_t slot = harness.table().find(id.number());
    CHECK(reported(harness).size() == (frame == 0 ? reported_first : 0));
    CHECK(harness.report().moved == (frame == 0 || x != before ? 1 : 0));
    CHECK(harness.report().handed_over == (host_at(x) == host_at(before) ? 0 : 1));
    CHECK(harness.table().host(slot) == host_at(x));
    CHECK(harness.server().pose(slot).position.x == x);
    harness.require_one_host_each();
  }
}

TEST_CASE("where no node may be lost, an object is reported when it appears, not when it rests or changes its host") {
  const std::vector<double> places = {4, 5, 6, 6, 6, 7, 31.5, 31.5, 33.5, 33.5, 34};
  follow_without_losses(ScriptedModel(places), places.size(), 1);
}

TEST_CASE("where no node may be lost, an object that first rests is not reported when it moves") {
  // The first move is within the region, to the border, or to the other region.
  for (const double first : {5.0, 31.5, 33.5}) {
    CAPTURE(first);
    const std::vector<double> places = {3, 3, 3, first, first, first + 1, 40};
    follow_without_losses(ScriptedModel(places, false), places.size(), 0);
  }
}

TEST_CASE("a placed or removed object continues from the state that its host had") {
  const std::vector<double> places = {4, 5, 6, 7, 8, 9, 10, 11};
  const ScriptedModel model(places);
  TestHarness harness(stage(model));
  const ObjectId id = harness.spawn(ball_at(harness, 3));
  const auto y = [&] { return harness.server().pose(harness.table().find(id.number())).position.y; };
  for (int frame = 0; frame < 3; ++frame) harness.frame();
  Pose pose;
  pose.position = {50, 9, 9};  // elsewhere, until the model moves it back in the same frame
  harness.place(id, pose);
  harness.frame();
  // It has jumped, which only a report can say.
  CHECK(reported(harness) == std::vector{at_home | messages::flag_jumped});
  CHECK(y() == 9);
  harness.frame();
  CHECK(reported(harness) == std::vector{at_home | messages::flag_host_owned});
  harness.frame();
  CHECK(reported(harness).empty());
  harness.destroy(id);
  harness.frame();
  harness.require_one_host_each();
  CHECK(harness.table().live() == 0);
}

TEST_CASE("after a loss the server can read the node's host-owned states of the frame before and of this frame") {
  const std::vector<double> places = {4, 5, 6, 7, 8, 9, 10, 11};
  for (std::size_t messages = 0; messages < 16; ++messages) {
    CAPTURE(messages);
    const ScriptedModel model(places);
    TestHarness harness(stage(model));
    const ObjectId id = harness.spawn(ball_at(harness, 3));
    for (std::size_t frame = 0; frame < places.size(); ++frame) {
      if (frame == 4) harness.kill(0, messages);
      harness.frame();
      CHECK(harness.server().pose(harness.table().find(id.number())).position.x == places[frame]);
    }
    harness.require_one_host_each();
  }
}

TEST_CASE("host-owned states of a frame stay unchanged while those of the next are written, with the model's state") {
  constexpr std::size_t state_bytes = 24;
  HostOwnedStates kept;
  kept.reserve(4, state_bytes);
  const auto number = [](std::uint64_t frame, std::uint32_t i) { return static_cast<std::uint32_t>(100 * frame) + i; };
  const auto require = [&](std::uint64_t frame, std::uint32_t size) {
    REQUIRE(kept.of(frame).size() == size);
    for (std::uint32_t i = 0; i < size; ++i) {
      CHECK(kept.of(frame)[i].object.number == number(frame, i));
      CHECK(kept.of(frame)[i].pose.position.z == number(frame, i));
      std::array<std::uint32_t, state_bytes / 4> state;
      std::memcpy(state.data(), kept.state(frame, i), state_bytes);
      for (const std::uint32_t word : state) CHECK(word == number(frame, i));
    }
  };
  for (std::uint64_t frame = 0; frame < 6; ++frame) {
    const auto size = static_cast<std::uint32_t>(frame * 17 % 40);  // more than was reserved
    kept.begin(frame);
    for (std::uint32_t i = 0; i < size; ++i) {
      Pose pose;
      pose.position.z = number(frame, i);
      std::array<std::uint32_t, state_bytes / 4> state;
      state.fill(number(frame, i));
      kept.add(frame, {i, 1, number(frame, i), messages::flag_present}, pose,
               reinterpret_cast<const std::byte*>(state.data()));
      if (frame > 0) require(frame - 1, static_cast<std::uint32_t>((frame - 1) * 17 % 40));
    }
    kept.finish();
    require(frame, size);
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
