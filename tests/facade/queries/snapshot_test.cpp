// Queries about snapshots of a World.
#include <atomic>
#include <limits>
#include <optional>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "facade/queries/all_objects.hpp"
#include "facade/queries/random_queries.hpp"
#include "facade/script.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 16;

WorldConfig small_world() {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.layers.names = {"solid", "ghost"};
  config.layers.collide = {{0, 0}};
  config.motion = std::make_shared<BouncingModel>(side);
  return config;
}

/// Two crossing walls of twelve triangles each.
TriangleMesh walls() {
  TriangleMesh mesh;
  for (int i = 0; i <= 6; ++i) {
    const float at = static_cast<float>(i - 3);
    mesh.vertices.insert(mesh.vertices.end(), {{at, 0, -2}, {at, 0, 2}, {0, at, -2}, {0, at, 2}});
  }
  for (std::uint32_t i = 0; i < 6; ++i) {
    for (const std::uint32_t first : {4 * i, 4 * i + 2}) {
      mesh.indices.insert(mesh.indices.end(), {first, first + 1, first + 4, first + 1, first + 5, first + 4});
    }
  }
  return mesh;
}

std::vector<ShapeId> convex_shapes(const World& world) {
  std::vector<ShapeId> out;
  for (std::uint32_t i = 0; i < world.shape_count(); ++i) {
    if (!std::holds_alternative<TriangleMesh>(world.shape(ShapeId(i)))) out.emplace_back(i);
  }
  return out;
}

/// A world of all kinds of shapes and categories, with a mesh in the middle.
struct Scene {
  explicit Scene(const WorldConfig& config, unsigned seed = 1) : world(config), script(world, seed, side) {
    const ShapeId mesh = world.add_shape(walls());
    REQUIRE(world.spawn({.shape = mesh, .category = Category::fixed, .pose = {{8, 8, 8}, {}}}).status == Status::ok);
  }
  void run(int frames) {
    for (int i = 0; i < frames; ++i) {
      script.make_requests();
      advance(world);
    }
  }
  Queries queries(std::size_t count, unsigned seed) const {
    return make_queries(world, convex_shapes(world), side, count, seed);
  }

  World world;
  Script script;
};

TEST_CASE("queries find what a test of every object finds, the same in each deployment") {
  std::optional<Answers> first;
  in_all_worlds(small_world(), {0u, 1u, 3u}, [&](const WorldConfig& config) {
    Scene scene(config);
    Answers all;
    std::size_t found = 0;
    for (unsigned round = 0; round < 4; ++round) {
      scene.run(5);
      const Queries queries = scene.queries(40, round);
      QueryWork work;
      const Answers answers = answer(scene.world.snapshot(), queries, &work);
      CHECK((answers == AllObjects(scene.world).answer(queries)));
      CHECK(work.queries == 280);
      CHECK(work.tests > 0);
      for (const Hit& hit : answers.hits) found += hit ? 1 : 0;
      all.hits.insert(all.hits.end(), answers.hits.begin(), answers.hits.end());
    }
    CHECK(found > 300);
    if (!first) first = all;
    CHECK((all == *first));
  });
}

TEST_CASE("a snapshot answers as before while its world changes, and after the world has ended") {
  std::vector<std::pair<Snapshot, Answers>> pinned;
  std::optional<Queries> queries;
  {
    WorldConfig config = small_world();
    config.nodes = 2;
    Scene scene(config);
    for (int round = 0; round < 6; ++round) {
      scene.run(3);
      if (!queries) queries = scene.queries(30, 9);
      const Snapshot snapshot = scene.world.snapshot();
      CHECK(snapshot.frame() + 1 == scene.world.frames());
      pinned.emplace_back(snapshot, answer(snapshot, *queries));
      CHECK((round == 0 || !(pinned[0].second == pinned.back().second)));
      for (const auto& [frame, answers] : pinned) CHECK((answer(frame, *queries) == answers));
    }
  }
  for (const auto& [frame, answers] : pinned) CHECK((answer(frame, *queries) == answers));
}

TEST_CASE("threads query snapshots while the world runs frames") {
  WorldConfig config = small_world();
  config.nodes = 2;
  Scene scene(config, 5);
  scene.run(2);
  const Queries queries = scene.queries(10, 3);
  for (int round = 0; round < 5; ++round) {
    const Snapshot snapshot = scene.world.snapshot();
    const Answers expected = answer(snapshot, queries);
    std::vector<std::thread> threads;
    std::atomic<int> same{0};
    for (int i = 0; i < 3; ++i) {
      threads.emplace_back([&, copy = snapshot]() mutable {
        same += answer(copy, queries) == expected ? 1 : 0;
        const Snapshot moved = std::move(copy);
        same += answer(moved, queries) == expected ? 1 : 0;
      });
    }
    scene.run(2);
    for (std::thread& thread : threads) thread.join();
    CHECK(same == 6);
  }
}

TEST_CASE("a snapshot is empty before the first frame, and of a running frame only the frame before can be had") {
  World world(small_world());
  const ShapeId ball = world.add_shape(Sphere{1});
  REQUIRE(world.spawn({.shape = ball, .category = Category::fixed, .pose = {{1, 2, 3}, {}}}).status == Status::ok);
  const RayQuery ray{{-9, 2, 3}, {20, 0, 0}};
  CHECK(!world.snapshot());
  CHECK(world.snapshot().cast(ray).status == Status::out_of_order);
  CHECK(Snapshot().cast_any(ray).status == Status::out_of_order);
  HitLists lists;
  Snapshot().cast_all({&ray, 1}, lists);
  REQUIRE(lists.size() == 1);
  CHECK(lists.status(0) == Status::out_of_order);
  REQUIRE(world.begin_frame() == Status::ok);
  CHECK(!world.snapshot());
  REQUIRE(world.finish_frame() == Status::ok);
  REQUIRE(world.begin_frame() == Status::ok);
  CHECK(!world.snapshot());
  REQUIRE(world.finish_frame() == Status::ok);
  const Snapshot second = world.snapshot();
  CHECK(second.objects() == 1);
  REQUIRE(world.begin_frame() == Status::ok);
  CHECK(world.snapshot().frame() == 1);
  CHECK(world.snapshot().cast(ray));
  REQUIRE(world.finish_frame() == Status::ok);
  CHECK(world.snapshot().frame() == 2);
  CHECK(second.frame() == 1);
}

TEST_CASE("a query that is not valid is refused, and the others of its batch are answered") {
  World world(small_world());
  const ShapeId ball = world.add_shape(Sphere{1}), mesh = world.add_shape(walls()), gone = world.add_shape(Sphere{2});
  const ObjectId object =
      world.spawn({.shape = ball, .category = Category::fixed, .user_data = 77, .pose = {{1, 2, 3}, {}}}).id;
  REQUIRE(world.remove_shape(gone) == Status::ok);
  REQUIRE(world.advance() == Status::ok);
  const Snapshot snapshot = world.snapshot();
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();

  const std::vector<RayQuery> rays = {
      {{nan, 0, 0}, {1, 0, 0}}, {{0, 0, 0}, {0, inf, 0}}, {{2e15, 0, 0}, {1, 0, 0}}, {{-4, 2, 3}, {10, 0, 0}}};
  std::vector<Hit> hits(4);
  snapshot.cast(rays, hits);
  for (int i = 0; i < 3; ++i) CHECK((hits[i].status == Status::not_finite && !hits[i]));
  CHECK(hits[3].status == Status::ok);
  CHECK(hits[3].object == object);
  CHECK(hits[3].user_data == 77);
  CHECK(hits[3].fraction == doctest::Approx(0.4));

  const Pose here{{-4, 2, 3}, {}};
  const std::vector<SweepQuery> sweeps = {
      {mesh, here, {10, 0, 0}},        {gone, here, {10, 0, 0}},
      {ShapeId(99), here, {10, 0, 0}}, {ball, {{-4, 2, 3}, {0, 0, 0, 0}}, {10, 0, 0}},
      {ball, here, {nan, 0, 0}},       {ball, here, {10, 0, 0}}};
  const Status expected[] = {Status::bad_shape, Status::unknown_shape, Status::unknown_shape,
                             Status::not_unit,  Status::not_finite,    Status::ok};
  HitLists lists;
  snapshot.sweep_all(sweeps, lists);
  REQUIRE(lists.size() == 6);
  for (std::size_t i = 0; i < 6; ++i) CHECK(lists.status(i) == expected[i]);
  REQUIRE(lists[5].size() == 1);
  CHECK(lists[5][0].fraction == doctest::Approx(0.3));
  CHECK(lists.all().size() == 1);

  CHECK(snapshot.nearest({{0, 0, 0}, -1}).status == Status::bad_number);
  CHECK(snapshot.nearest({{0, 0, 0}, nan}).status == Status::bad_number);
  CHECK(snapshot.nearest({{0, inf, 0}, 1}).status == Status::not_finite);
  CHECK(snapshot.nearest({{1, 2, 9}}).distance == doctest::Approx(5));
  CHECK(!snapshot.nearest({{1, 2, 9}, 4.9}));
}

TEST_CASE("a shape that is removed stays as it was in the snapshots of frames that have it") {
  World world(small_world());
  const ShapeId hull =
      world.add_shape(ConvexHull{{{2, 0, 0}, {-2, 0, 0}, {0, 2, 0}, {0, -2, 0}, {0, 0, 2}, {0, 0, -2}}});
  const ObjectId object = world.spawn({.shape = hull, .category = Category::fixed, .pose = {{5, 5, 5}, {}}}).id;
  REQUIRE(world.advance() == Status::ok);
  std::optional<Snapshot> before = world.snapshot();
  REQUIRE(world.destroy(object) == Status::ok);
  REQUIRE(world.advance() == Status::ok);
  REQUIRE(world.remove_shape(hull) == Status::ok);
  for (int i = 0; i < 3; ++i) REQUIRE(world.advance() == Status::ok);
  const Hit hit = before->cast({{0, 5, 5}, {10, 0, 0}});
  CHECK(hit.object == object);
  CHECK(hit.fraction == doctest::Approx(0.3));
  CHECK(!world.snapshot().cast({{0, 5, 5}, {10, 0, 0}}));
  before.reset();
  for (int i = 0; i < 3; ++i) REQUIRE(world.advance() == Status::ok);
  CHECK(world.snapshot().sweep({hull, {{0, 5, 5}, {}}, {1, 0, 0}}).status == Status::unknown_shape);
}

}  // namespace
}  // namespace ringfence::test
