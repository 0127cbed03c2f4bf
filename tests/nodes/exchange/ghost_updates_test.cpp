// What CD nodes that share memory tell each other of objects near their borders.
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

TEST_CASE("a halo tells each node what was meant for it, and nobody anything else") {
  std::mt19937_64 random(7);
  GhostUpdates ghost_updates;
  ghost_updates.reserve(4);
  for (std::uint64_t frame = 0; frame < 50; ++frame) {
    const auto nodes = static_cast<NodeNumber>(1 + random() % 9);
    std::map<NodeNumber, std::vector<std::pair<ObjectNumber, bool>>> meant;
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
          meant[peer].push_back({number, gone});
          ++entries;
        }
      }
    }
    ghost_updates.finish(nodes);
    CHECK(ghost_updates.frame() == frame);
    CHECK(ghost_updates.size() == entries);
    for (NodeNumber peer = 0; peer < nodes; ++peer) {
      base::FlatList<GhostUpdates::Update> told;
      ghost_updates.list(peer, told);
      REQUIRE(told.size() == meant[peer].size());
      for (std::size_t i = 0; i < told.size(); ++i) {
        CHECK(told[i].record->object.number == meant[peer][i].first);
        CHECK(told[i].record->pose.position.x == meant[peer][i].first * 0.5);
        CHECK(told[i].gone == meant[peer][i].second);
      }
    }
  }
}

/// The first stands, the second is where a table says.
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

/// Two nodes with a border at 32.
HarnessConfig stage(const MotionModel& model, bool shares_memory) {
  HarnessConfig play;
  play.placement = Placement::region;
  play.shares_memory = shares_memory;
  play.nodes = 2;
  play.grid = {{2, 0, 0}};
  play.model = &model;
  return play;
}

/// Of how many objects the server told nodes in the last frame, each time that it did.
std::size_t notified_by_server(const TestHarness& harness) {
  std::size_t records = 0;
  for (const LoggedMessage& seen : harness.log()) {
    records += seen.type() == MessageType::position_update ? seen.header.count : 0;
  }
  return records;
}

TEST_CASE("a node hears from its peer, not from the server, of what comes near the border, crosses it and goes") {
  // The border is at 32, what stands reaches from 32.5 to 34.5.
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
    // In the first frame what stands, of which no host reports; then all is in the hosts' hands.
    CHECK(by_server == (frame == 0 ? 1 : 0));
    // Of what touches the other's region, and once more when it does so no longer.
    const auto over_border = [&](std::size_t f) { return places[f] >= 31 && places[f] <= 33; };
    const bool told =
        frame > 0 && (over_border(frame) || over_border(frame - 1) || (places[frame - 1] < 32) != (places[frame] < 32));
    CHECK(harness.report().traffic[static_cast<std::size_t>(Traffic::m2)].records == by_server + (told ? 1 : 0));
    harness.require_one_host_each();
  }
}

TEST_CASE("under a new map nodes tell each other what they host, what rests included, and the server only the rest") {
  const std::vector<double> places = {4, 5, 14, 17, 18, 30, 33, 33, 34, 46, 49, 47, 31, 20, 15, 4, 3, 3, 2, 2};
  const VisitingModel model(places);
  TestHarness harness(stage(model, true));
  ObjectSpec spec;
  spec.shape = harness.add_shape(Sphere{1});
  spec.pose.position = {3, 40, 8};
  harness.spawn(spec);
  harness.spawn(spec);  // number 2, which moves
  // Two that touch each other about every border between cells, and one that nobody moves.
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
  const geometry::Bounds fixed = harness.shapes().bounds(spec.shape, spec.pose, harness.space());
  std::uint32_t epoch = 1;  // of the map of the frame before
  std::size_t maps = 0;
  for (std::size_t frame = 0; frame < places.size(); ++frame) {
    CAPTURE(frame);
    if (const auto at = resizes.find(frame); at != resizes.end()) {
      harness.resize(at->second);
    }
    const regions::RegionMap map = harness.server().map();
    harness.frame();
    const auto visits = [&](std::size_t f) { return places[f] <= 5; };  // the first, which stands at 3
    CHECK(harness.contacts().size() == 3u + (visits(frame) ? 1 : 0));
    CHECK(harness.ended().size() == (frame > 0 && visits(frame - 1) && !visits(frame) ? 1 : 0));
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

TEST_CASE("a node forgets what alone touched it and stood in another's region, when it has gone") {
  // The border is at 32; from 5 to 15 m beyond where it stands the hull is solid, so it is given to the first node
  // while all of it is in the second's region.
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
