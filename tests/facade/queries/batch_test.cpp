// Batches of queries that the CD nodes answer.
#include <algorithm>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "facade/queries/batches.hpp"
#include "facade/queries/random_queries.hpp"
#include "facade/script.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 16;

WorldConfig small_world() {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.interest = 4;
  config.layers.names = {"solid", "ghost"};
  config.layers.collide = {{0, 0}};
  config.motion = std::make_shared<BouncingModel>(side);
  return config;
}

/// The first shapes of Script: one of each kind. Support shapes are slow.
std::vector<ShapeId> some_shapes() { return {ShapeId(0), ShapeId(1), ShapeId(2), ShapeId(3)}; }

void append(Answers& all, const Answers& more) { all.hits.insert(all.hits.end(), more.hits.begin(), more.hits.end()); }

TEST_CASE(
    "the CD nodes answer batches as a snapshot of the frame does, in each deployment, while nodes join and leave") {
  std::optional<Answers> first;
  in_all_worlds(small_world(), {0u, 1u, 3u}, [&](const WorldConfig& config) {
    World world(config);
    Script script(world, 7, side);
    script.make_requests();
    advance(world);
    Answers all;
    std::size_t found = 0;
    for (unsigned frame = 0; frame < 24; ++frame) {
      CAPTURE(frame);
      script.make_requests();
      if (frame % 4 == 3) REQUIRE(world.resize(config.nodes == 0 ? 2 : 1 + frame / 4 % 4) == Status::ok);
      const Queries queries[] = {make_queries(world, some_shapes(), side, 12, frame),
                                 make_queries(world, some_shapes(), side, frame % 3, frame + 100)};
      QueryBatch batches[] = {batch_of(queries[0]), batch_of(queries[1])};
      for (QueryBatch& batch : batches) REQUIRE(world.attach(batch) == Status::ok);
      advance(world);
      const Snapshot snapshot = world.snapshot();
      for (std::size_t i = 0; i < 2; ++i) {
        CHECK(batches[i].answers.frame == world.report().frame);
        const Answers answers = answers_of(batches[i]);
        CHECK((answers == answer(snapshot, queries[i])));
        append(all, answers);
        for (const Hit& hit : answers.hits) found += hit ? 1 : 0;
      }
      const FrameReport& report = world.report();
      CHECK(report.recomputed_batches == 0);
      CHECK(report.queries.queries == 7 * (12 + frame % 3));
      CHECK(report.queries.tests > 0);
      std::uint64_t tests = 0, boxes = 0;
      for (const NodeReport& node : report.nodes) tests += node.query_tests, boxes += node.query_boxes;
      CHECK(tests == report.queries.tests);
      CHECK(boxes == report.queries.boxes);
    }
    CHECK(found > 500);
    if (!first) first = all;
    CHECK((all == *first));
  });
}

TEST_CASE("a frame in which CD nodes are lost has the same answers, and the next ones too") {
  for (const Deployment deployment : {Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      WorldConfig config = small_world();
      config.deployment = deployment;
      config.placement = placement;
      config.nodes = 6;
      config.deadlines.node_ms = 200;
      CAPTURE(describe(config));
      World world(config);
      Script script(world, 3, side);
      script.make_requests();
      advance(world);
      std::size_t lost = 0, recomputed = 0;
      for (unsigned frame = 1; frame <= 12; ++frame) {
        CAPTURE(frame);
        script.make_requests();
        if (frame % 2 == 1) {
          // The node that is named may have been lost already.
          (void)world.inject({.node = NodeId(frame / 2),
                              .frame = frame,
                              .stage = static_cast<NodeStage>(frame / 2),
                              .stall_ms = frame % 4 == 1 ? 500.0 : 0});
        }
        const Queries queries = make_queries(world, some_shapes(), side, 12, frame);
        QueryBatch batch = batch_of(queries);
        REQUIRE(world.attach(batch) == Status::ok);
        REQUIRE(world.advance() == Status::ok);
        const FrameReport& report = world.report();
        CHECK((answers_of(batch) == answer(world.snapshot(), queries)));
        CHECK(report.recomputed_batches == (report.lost.empty() ? 0u : 1u));
        CHECK(report.queries.queries == 7 * 12);
        lost += report.lost.size();
        recomputed += report.recomputed_batches;
      }
      CHECK(lost >= 4);
      CHECK(recomputed >= 4);
      world.release_faults();
    }
  }
}

TEST_CASE("a batch is attached once, between frames, and for one frame") {
  for (const std::uint32_t nodes : {0u, 2u}) {
    WorldConfig config = small_world();
    config.nodes = nodes;
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    REQUIRE(world.spawn({.shape = ball, .category = Category::fixed, .pose = {{5, 2, 3}, {}}}).status == Status::ok);
    QueryBatch batch;
    batch.cast.push_back({{1, 2, 3}, {10, 0, 0}});
    REQUIRE(world.attach(batch) == Status::ok);
    CHECK(world.attach(batch) == Status::out_of_order);
    REQUIRE(world.begin_frame() == Status::ok);
    QueryBatch other;
    CHECK(world.attach(other) == Status::out_of_order);
    REQUIRE(world.finish_frame() == Status::ok);
    CHECK(refused(world, Status::out_of_order) == 2);
    CHECK(batch.answers.frame == 0);
    REQUIRE(batch.answers.cast.size() == 1);
    CHECK(batch.answers.cast[0].fraction == doctest::Approx(0.3));
    REQUIRE(world.advance() == Status::ok);
    CHECK(batch.answers.frame == 0);
    CHECK(world.report().queries.queries == 0);
    REQUIRE(world.attach(batch) == Status::ok);
    REQUIRE(world.attach(other) == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    CHECK(batch.answers.frame == 2);
    CHECK(other.answers.frame == 2);
  }
}

TEST_CASE("a World can end while a frame with a batch is running, after the batch has ended") {
  for (const std::uint32_t nodes : {0u, 2u}) {
    WorldConfig config = small_world();
    config.nodes = nodes;
    World world(config);
    const Script script(world, 1, side);
    QueryBatch batch;
    batch.cast_all.assign(1000, {{0, 0, 0}, {side, side, side}});
    REQUIRE(world.attach(batch) == Status::ok);
    REQUIRE(world.begin_frame() == Status::ok);
  }
}

TEST_CASE("queries that are not valid are refused, those about another frame are answered, and so are the others") {
  for (const std::uint32_t nodes : {0u, 1u, 3u}) {
    WorldConfig config = small_world();
    config.nodes = nodes;
    config.history = 3;
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1}), gone = world.add_shape(Sphere{2});
    const ShapeId mesh = world.add_shape(TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2}});
    for (int i = 0; i < 20; ++i) {
      REQUIRE(world.spawn({.shape = i % 5 == 0 ? mesh : ball, .pose = {{i % 4 * 4.0, i / 4 * 3.0, 8}, {}}}).status ==
              Status::ok);
    }
    REQUIRE(world.remove_shape(gone) == Status::ok);
    for (int i = 0; i < 6; ++i) REQUIRE(world.advance() == Status::ok);
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    Queries queries;
    const Vec3d along{20, 15, 1};
    for (const QueryFrame& frame : {QueryFrame(), QueryFrame(6), QueryFrame(4.5), QueryFrame(1), QueryFrame(99)}) {
      queries.rays.push_back({{-1, 0, 8}, along, {}, frame});
      queries.rays.push_back({{nan, 0, 8}, along, {}, frame});
      queries.sweeps.push_back({ball, {{-1, 0, 8}, {}}, along, {}, frame});
      queries.sweeps.push_back({mesh, {{-1, 0, 8}, {}}, along, {}, frame});
      queries.sweeps.push_back({gone, {{-1, 0, 8}, {}}, along, {}, frame});
      queries.overlaps.push_back({ball, {{4, 3, 8}, {}}, {}, frame});
      queries.overlaps.push_back({ball, {{4, 3, 8}, {0, 0, 0, 0}}, {}, frame});
      queries.nearest.push_back({{1, 2, 3}, 10, {}, frame});
      queries.nearest.push_back({{1, 2, 3}, -1, {}, frame});
    }
    QueryBatch batch = batch_of(queries);
    REQUIRE(world.attach(batch) == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    const Answers answers = answers_of(batch);
    QueryWork work;
    CHECK((answers == answer(world.snapshot(), queries, &work)));
    CHECK(world.report().queries.queries == work.queries);
    CHECK(world.report().recomputed_batches == 0);
    for (const Status status : {Status::not_finite, Status::not_unit, Status::bad_number, Status::unknown_shape,
                                Status::bad_shape, Status::frame_expired, Status::ok}) {
      CAPTURE(name_of(status));
      CHECK(std::count_if(answers.hits.begin(), answers.hits.end(),
                          [&](const Hit& hit) { return hit.status == status; }) > 0);
    }
  }
}

}  // namespace
}  // namespace ringfence::test
