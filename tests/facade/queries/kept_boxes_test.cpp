// Snapshots keep what has not changed since an earlier one: against brute force, in worlds in which most objects rest.
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "facade/queries/all_objects.hpp"
#include "facade/queries/batches.hpp"
#include "facade/queries/random_queries.hpp"
#include "facade/script.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 16;

/// Moves an object in every third frame, and a quarter of the objects never.
class ResumingModel : public BouncingModel {
 public:
  using BouncingModel::BouncingModel;
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const bool moves = inputs[i].number % 4 != 0 && (inputs[i].number + frame) % 3 == 0;
      if (moves) BouncingModel::move(frame, inputs.subspan(i, 1), outputs.subspan(i, 1));
    }
  }
};

Queries some_queries(const World& world, unsigned seed) {
  std::vector<ShapeId> shapes;
  for (std::uint32_t i = 0; i < 3; ++i) shapes.emplace_back(i);
  return make_queries(world, shapes, side, 10, seed);
}

/// Changes a world by a script, and compares snapshots and the answers of CD nodes with brute force, not in every
/// frame. Some snapshots stay, so that the next ones are recorded in other places. `prepare(world, frame)` is called
/// before each frame.
template <class Prepare>
void run(const WorldConfig& config, unsigned seed, Prepare prepare) {
  World world(config);
  Script script(world, seed, side);
  script.make_requests();
  REQUIRE(world.advance() == Status::ok);
  std::mt19937 random(seed);
  std::deque<Snapshot> kept;
  std::map<std::uint64_t, std::pair<Queries, Answers>> then;  // by frame
  for (int frame = 1; frame < 40; ++frame) {
    CAPTURE(frame);
    if (random() % 2 == 0) script.make_requests();
    prepare(world, frame);
    const Queries queries = some_queries(world, seed + static_cast<unsigned>(frame));
    QueryBatch batch = batch_of(queries);
    const bool attached = random() % 2 == 0;
    if (attached) REQUIRE(world.attach(batch) == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    const bool recorded = random() % 3 != 0;
    if (recorded) kept.push_back(world.snapshot());
    const bool asked = recorded && random() % 4 != 0;
    if (attached || asked) {
      const Answers right = AllObjects(world).answer(queries);
      if (attached) REQUIRE((answers_of(batch) == right));
      if (asked) REQUIRE((answer(kept.back(), queries) == right));
      then[world.report().frame] = {queries, right};
    }
    if (asked && config.history != 0) {
      const std::uint64_t oldest = kept.back().oldest_frame();
      const auto earlier = then.lower_bound(oldest + random() % (kept.back().frame() - oldest + 1));
      const auto& [wanted, right] = earlier->second;
      REQUIRE((answer(kept.back(), about(wanted, static_cast<double>(earlier->first))) == right));
    }
    while (kept.size() > random() % 4) kept.pop_front();
  }
}

WorldConfig resting_world() {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.motion = std::make_shared<ResumingModel>(side);
  return config;
}

TEST_CASE("a snapshot is right when most boxes are kept, while objects rest, change, come, go and change hosts") {
  in_all_worlds(resting_world(), {0u, 1u, 4u}, [](const WorldConfig& config) {
    for (const unsigned seed : {1u, 2u}) {
      run(config, seed, [&](World& world, int frame) {
        if (config.nodes == 0 || frame % 9 != 8) return;
        REQUIRE(world.resize(1 + (config.nodes + static_cast<std::uint32_t>(frame)) % 5) == Status::ok);
      });
    }
  });
}

TEST_CASE("frames of a history are right when most boxes are kept") {
  WorldConfig base = resting_world();
  base.history = 19;
  in_all_worlds(base, {0u, 3u}, [](const WorldConfig& config) {
    for (const unsigned seed : {4u, 5u}) run(config, seed, [](World&, int) {});
  });
}

TEST_CASE("a snapshot is right after nodes were lost") {
  WorldConfig base = resting_world();
  base.deadlines.node_ms = 60;
  in_all_worlds(base, {3u}, [](const WorldConfig& config) {
    run(config, 3, [&](World& world, int frame) {
      if (frame % 13 != 7) return;
      for (const NodeReport& node : world.report().nodes) {
        Fault fault;
        fault.node = node.id;
        fault.frame = static_cast<std::uint64_t>(frame);
        fault.stage = frame % 2 == 0 ? NodeStage::moving : NodeStage::ending;
        REQUIRE(world.inject(fault) == Status::ok);
        break;
      }
    });
  });
}

}  // namespace
}  // namespace ringfence::test
