// Ghost updates between CD nodes that share memory, for objects near their borders.
#include "nodes/exchange/ghost_updates.hpp"

#include <cstring>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {
namespace {

TEST_CASE("ghost updates reach exactly the nodes that they were added for") {
  std::mt19937_64 random(7);
  GhostUpdates ghost_updates;
  ghost_updates.reserve(4);
  for (std::uint64_t frame = 0; frame < 50; ++frame) {
    const auto nodes = static_cast<NodeNumber>(1 + random() % 9);
    std::map<NodeNumber, std::vector<std::pair<ObjectNumber, bool>>> expected;
    ghost_updates.start(frame);
    std::size_t entries = 0;
    for (ObjectNumber number = static_cast<ObjectNumber>(random() % 300); number > 0; --number) {
      messages::PositionRecord record;
      record.object.number = number;
      record.pose.position.x = number * 0.5;
      ghost_updates.add(record);
      for (NodeNumber peer = 0; peer < nodes; ++peer) {
        if (random() % 3 == 0) {
          const bool gone = random() % 4 == 0;
          ghost_updates.add_receiver(peer, gone);
          expected[peer].push_back({number, gone});
          ++entries;
        }
      }
    }
    ghost_updates.finish(nodes);
    CHECK(ghost_updates.frame() == frame);
    CHECK(ghost_updates.size() == entries);
    for (NodeNumber peer = 0; peer < nodes; ++peer) {
      base::FlatList<GhostUpdates::Update> updates;
      ghost_updates.list(peer, updates);
      REQUIRE(updates.size() == expected[peer].size());
      for (std::size_t i = 0; i < updates.size(); ++i) {
        CHECK(updates[i].record->object.number == expected[peer][i].first);
        CHECK(updates[i].record->pose.position.x == expected[peer][i].first * 0.5);
        CHECK(updates[i].gone == expected[peer][i].second);
      }
    }
  }
}

/// Object 2 moves along x by a table with one position for each frame. The others do not move.
class VisitingModel : public MotionModel {
 public:
  explicit VisitingModel(std::vector<double> places) : places_(std::move(places)) {}
  std::size_t state_bytes() const noexcept override { return 0; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].number == 2) {
        outputs[i].pose.position.x = places_[frame];
      }
    }
  }

 private:
  std::vector<double> places_;
};

/// Two nodes with a border at x = 32.
HarnessConfig stage(const MotionModel& model, bool shares_memory) {
  HarnessConfig config;
  config.placement = Placement::region;
  config.shares_memory = shares_memory;
  config.nodes = 2;
  config.grid = {{2, 0, 0}};
  config.model = &model;
  return config;
}

/// Number of position records that the server sent to nodes in the last frame.
std::size_t notified_by_server(const TestHarness& harness) {
  std::size_t records = 0;
  for (const LoggedMessage& seen : harness.log()) {
    records += seen.type() == MessageType::position_update ? seen.header.count : 0;
  }
  return records;
}

TEST_CASE("a node receives objects near the border, crossing it and leaving it from its peer, not from the server") {
  // The border is at 32; the object at rest reaches from 32.5 to 34.5.
  const std::vector<double> places = {4, 20, 31.5, 31.2, 29.9, 20, 31.5, 33.5, 40, 36.5, 34.5, 31.5, 20, 21};
  const VisitingModel model(places);
  TestHarness harness(stage(model, true));
  ObjectSpec spec;
  spec.shape = harness.add_shape(Sphere{1});
  spec.pose.position = {33.5, 8, 8};
  harness.spawn(spec);
  spec.pose.position = {3, 8, 8};
  harness.spawn(spec);
  for (std::size_t frame = 0; frame < places.size(); ++frame) {
    CAPTURE(frame);
    harness.frame();
    const bool touch = places[frame] >= 31.5 && places[frame] <= 35.5;
    CHECK(harness.contacts().size() == (touch ? 1 : 0));
    const std::size_t by_server = notified_by_server(harness);
    // In the first frame the server sends the resting object, because no host reports it. Later it sends nothing.
    CHECK(by_server == (frame == 0 ? 1 : 0));
    // The host sends an update while the object touches the other node's region, and one removal after that.
    const auto touches_other = [&](std::size_t f) { return places[f] >= 31 && places[f] <= 33; };
    const bool updates = frame > 0 && (touches_other(frame) || touches_other(frame - 1) ||
                                       (places[frame - 1] < 32) != (places[frame] < 32));
    CHECK(harness.report().traffic[static_cast<std::size_t>(Traffic::m2)].records == by_server + (updates ? 1 : 0));
    harness.require_one_host_each();
  }
}

TEST_CASE(
    "under a new map nodes send each other all hosted objects, resting ones too, and the server sends the others") {
  const std::vector<double> places = {4, 5, 14, 17, 18, 30, 33, 33, 34, 46, 49, 47, 31, 20, 15, 4, 3, 3, 2, 2};
  const VisitingModel model(places);
  TestHarness harness(stage(model, true));
  ObjectSpec spec;
  spec.shape = harness.add_shape(Sphere{1});
  spec.pose.position = {3, 40, 8};
  harness.spawn(spec);
  harness.spawn(spec);  // object 2, which moves
  // Two touching objects at every border between cells, and one that never moves.
  for (const double border : {16.0, 32.0, 48.0}) {
    for (const double side : {-0.8, 0.8}) {
      spec.pose.position = {border + side, 8, 8};
      harness.spawn(spec);
    }
  }
  spec.category = Category::fixed;
  spec.pose.position = {40, 20, 8};
  harness.spawn(spec);
  const std::map<std::size_t, std::uint32_t> resizes = {{2, 4}, {5, 3}, {8, 1}, {11, 4}, {14, 2}};
  const geometry::Bounds fixed = harness.shapes().bounds(spec.shape.number(), spec.pose, harness.space());
  std::uint32_t epoch = 1;  // epoch of the map of the frame before
  std::size_t maps = 0;
  for (std::size_t frame = 0; frame < places.size(); ++frame) {
    CAPTURE(frame);
    if (const auto at = resizes.find(frame); at != resizes.end()) {
      harness.resize(at->second);
    }
    const regions::RegionMap map = harness.server().map();
    harness.frame();
    const auto touches_first = [&](std::size_t f) { return places[f] <= 5; };  // touches the first object, at x = 3
    CHECK(harness.contacts().size() == 3u + (touches_first(frame) ? 1 : 0));
    CHECK(harness.ended().size() == (frame > 0 && touches_first(frame - 1) && !touches_first(frame) ? 1 : 0));
    const std::size_t by_server = notified_by_server(harness);
    std::set<NodeNumber> owners;
    map.visit_owners(fixed, [&](NodeNumber owner) { return owners.insert(owner), true; });
    if (frame > 1) {
      CHECK(by_server == (map.epoch() != epoch ? owners.size() : 0));
    }
    maps += map.epoch() != epoch ? 1 : 0;
    epoch = map.epoch();
    harness.require_one_host_each();
  }
  CHECK(maps == resizes.size());
}

TEST_CASE("a node removes an object that touched only its region but was hosted elsewhere, when the object leaves") {
  // The border is at 32. The hull's origin is 5 to 15 m away from its solid part, so it is hosted by the first node
  // while all of it is in the second node's region.
  const std::vector<double> places = {32.5, 30, 4, 5, 30, 31, 33, 5};
  const VisitingModel model(places);
  for (const bool shares_memory : {false, true}) {
    CAPTURE(shares_memory);
    TestHarness harness(stage(model, shares_memory));
    ObjectSpec spec;
    spec.shape = harness.add_shape(Sphere{1});
    spec.pose.position = {38.5, 6.5, 6.5};
    harness.spawn(spec);
    spec.shape = harness.add_shape(ConvexHull{{{5, 1, 1}, {15, 1, 1}, {5, 9, 1}, {5, 1, 9}, {12, 7, 8}}});
    spec.pose.position = {33, 4, 4};
    harness.spawn(spec);
    for (std::size_t frame = 0; frame < places.size(); ++frame) {
      CAPTURE(frame);
      harness.frame();
      CHECK(harness.contacts().size() == (places[frame] >= 30 ? 1 : 0));
      harness.require_one_host_each();
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
