// Queries about histories of more than one block of frames.
#include <algorithm>
#include <map>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "facade/queries/all_objects.hpp"
#include "facade/queries/changing_world.hpp"
#include "facade/queries/random_queries.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

/// The frames that a snapshot can be asked about, and a time after each but the last.
std::vector<double> times_of(const Snapshot& snapshot) {
  std::vector<double> times;
  for (std::uint64_t frame = snapshot.oldest_frame(); frame <= snapshot.frame(); ++frame) {
    times.push_back(static_cast<double>(frame));
    if (frame != snapshot.frame()) times.push_back(static_cast<double>(frame) + 0.3125);
  }
  return times;
}

/// A world that changes, and what queries about each of its frames and times have to find.
struct KnownHistory {
  static constexpr double fraction = 0.3125;
  KnownHistory(const WorldConfig& config, unsigned seed) : changing(config, seed) {
    changing.run_frame();
    queries = make_queries(changing.world, changing.shapes, cube_side, 6, seed);
    remember();
  }
  void run_frame() {
    changing.run_frame();
    remember();
  }
  void remember() {
    const std::vector<ObjectView> now = changing.world.objects();
    const std::uint64_t frame = changing.world.report().frame;
    if (frame > 0) {
      const AllObjects way(changing.world, between(before, now, changing.placed, frame, fraction));
      known[static_cast<double>(frame) - 1 + fraction] = way.answer(queries);
    }
    known[static_cast<double>(frame)] = AllObjects(changing.world, now).answer(queries);
    before = now;
  }
  /// Asks about all times, and about random ones in one batch.
  void check(const Snapshot& snapshot, unsigned seed) const {
    const std::vector<double> times = times_of(snapshot);
    const Queries mixed = about_any(queries, times, seed);
    const Answers any = answer(snapshot, mixed);
    for (const double time : times) {
      CAPTURE(time);
      CHECK((answer(snapshot, about(queries, time)) == known.at(time)));
    }
    for (std::size_t i = 0; i < mixed.rays.size(); ++i) {
      CHECK((any.hits[i] == known.at(*mixed.rays[i].frame).hits[i]));
    }
    std::vector<Hit> hits(mixed.nearest.size());
    snapshot.nearest(mixed.nearest, hits);
    const std::size_t first = mixed.rays.size() + mixed.sweeps.size();
    for (std::size_t i = 0; i < hits.size(); ++i) {
      CHECK((hits[i] == known.at(*mixed.nearest[i].frame).hits[first + i]));
    }
    HitLists lists;
    snapshot.overlap(mixed.overlaps, lists);
    for (std::size_t i = 0; i < mixed.overlaps.size(); ++i) {
      HitLists alone;
      snapshot.overlap({&mixed.overlaps[i], 1}, alone);
      CHECK(std::equal(lists[i].begin(), lists[i].end(), alone[0].begin(), alone[0].end()));
    }
  }

  ChangingWorld changing;
  Queries queries;
  std::vector<ObjectView> before;
  std::map<double, Answers> known;
};

TEST_CASE("at each time of a long history a query finds what exact tests of all objects found") {
  WorldConfig base = world_with_history(20);
  base.motion = std::make_shared<JumpingModel>();
  in_all_worlds(base, {0u, 2u}, [](const WorldConfig& config) {
    KnownHistory history(config, 23);
    for (unsigned frame = 1; frame < 36; ++frame) {
      history.run_frame();
      // Sometimes the first queries about a block come when some of its frames have expired.
      if (frame % 5 == 0 || frame > 30) history.check(history.changing.world.snapshot(), frame);
    }
  });
}

TEST_CASE("a snapshot answers for frames that had expired when a later one was asked first") {
  WorldConfig config = world_with_history(20);
  config.motion = std::make_shared<JumpingModel>();
  KnownHistory history(config, 29);
  std::vector<Snapshot> snapshots;
  for (int frame = 1; frame < 60; ++frame) {
    history.run_frame();
    if (frame % 3 == 0) snapshots.push_back(history.changing.world.snapshot());
    if (snapshots.size() < 6) continue;
    history.check(snapshots.back(), 1);
    history.check(snapshots.front(), 2);
    history.check(snapshots[2], 3);
    snapshots.clear();
  }
}

TEST_CASE("threads that ask first about the same blocks of frames find the same") {
  WorldConfig config = world_with_history(20);
  config.motion = std::make_shared<JumpingModel>();
  for (unsigned round = 0; round < 6; ++round) {
    KnownHistory history(config, 31 + round);
    while (history.changing.world.report().frame < 26) history.run_frame();
    const Snapshot old = history.changing.world.snapshot();
    for (int i = 0; i < 4; ++i) history.run_frame();
    const Snapshot now = history.changing.world.snapshot();
    std::vector<Answers> found(4);
    std::vector<std::thread> threads;
    const Queries queries = about_any(history.queries, times_of(old), round);
    const Queries later = about_any(history.queries, times_of(now), round);
    for (std::size_t i = 0; i < found.size(); ++i) {
      threads.emplace_back([&, i] { found[i] = i % 2 == 0 ? answer(old, queries) : answer(now, later); });
    }
    for (std::thread& thread : threads) thread.join();
    CHECK((found[0] == answer(old, queries)));
    CHECK((found[2] == found[0]));
    CHECK((found[1] == answer(now, later)));
    CHECK((found[3] == found[1]));
    history.check(old, round);
    history.check(now, round);
  }
}

TEST_CASE("queries about a frame see the shapes that it had, also after these were removed and others were added") {
  WorldConfig config;
  config.history = 20;
  World world(config);
  const ShapeId gone =
      world.add_shape(ConvexHull{{{2, 0, 0}, {-2, 0, 0}, {0, 2, 0}, {0, -2, 0}, {0, 0, 2}, {0, 0, -2}}});
  const ObjectId object = world.spawn({.shape = gone, .category = Category::fixed, .pose = {{10, 0, 0}, {}}}).id;
  for (int i = 0; i < 5; ++i) REQUIRE(world.advance() == Status::ok);
  RayQuery ray{{0, 0, 0}, {20, 0, 0}};
  SweepQuery sweep{gone, {}, {20, 0, 0}};
  const auto ask = [&] {
    const Snapshot snapshot = world.snapshot();
    std::vector<Hit> hits(2);
    snapshot.cast({&ray, 1}, {&hits[0], 1});
    snapshot.sweep({&sweep, 1}, {&hits[1], 1});
    return hits;
  };
  const std::vector<Hit> then = ask();
  REQUIRE((then[0].object == object && then[1].object == object));
  ray.frame = sweep.frame = 4;
  CHECK(ask() == then);
  REQUIRE(world.destroy(object) == Status::ok);
  REQUIRE(world.advance() == Status::ok);
  REQUIRE(world.remove_shape(gone) == Status::ok);
  for (int frame = 6; frame < 20; ++frame) {
    CAPTURE(frame);
    (void)world.add_shape(Sphere{0.1f * static_cast<float>(frame)});
    REQUIRE(world.advance() == Status::ok);
    CHECK(ask() == then);
  }
  ray.frame = sweep.frame = 19;
  CHECK(!ask()[0]);
  CHECK(ask()[1].status == Status::unknown_shape);
}

}  // namespace
}  // namespace ringfence::test
