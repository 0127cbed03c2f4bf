// Searches in the swept bounds of some frames against exact tests of all objects at the time of each query.
#include "queries/swept_frames.hpp"

#include <algorithm>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "geometry/vector.hpp"
#include "queries/exact_answers.hpp"

namespace ringfence::queries_test {
namespace {

using queries::QueryTime;
using queries::SweptFrames;

using Frames = std::vector<std::vector<TestObject>>;

/// The next frame: objects move, turn, jump, disappear, return, change their shape and what filters read of them, and
/// others take their slots.
std::vector<TestObject> next_frame(const std::vector<TestObject>& before, Random& random, double step) {
  std::vector<TestObject> rows = before;
  for (TestObject& row : rows) {
    row.jumped = 0;
    if (random.below(4) == 0) continue;
    const Vec3d way = random.in_cube(step);
    const Vec3d& at = row.pose.position;
    row.pose.position = {at.x + way.x, at.y + way.y, at.z + way.z};
    if (random.below(2) == 0) row.pose.orientation = random.orientation();
    if (random.below(2) == 0) row.layer = static_cast<std::uint8_t>(random.below(5));
    switch (random.below(30)) {
      case 0:
        row.jumped = 1;
        row.pose.position = random.in_cube(10);
        break;
      case 1:
        row.number = row.number == 0 ? row.slot + 1 : 0;
        break;
      case 2:
        row.shape = static_cast<ShapeNumber>(random.below(shapes));
        break;
      case 3:
        ++row.generation;
        row.pose.position = random.in_cube(10);
        break;
      case 4:
        if (row.number != 0) row.number += 100000;
        break;
      default:
        break;
    }
  }
  return rows;
}

/// The objects at a time, by the rules of QueryFrame.
std::vector<TestObject> rows_at(const Frames& frames, const QueryTime& time) {
  std::vector<TestObject> rows = frames[time.frame];
  if (time.fraction == 0) return rows;
  for (TestObject& row : rows) {
    if (row.number == 0 || row.slot >= frames[time.frame + 1].size()) continue;
    const TestObject& then = frames[time.frame + 1][row.slot];
    const bool moves =
        then.number == row.number && then.generation == row.generation && then.shape == row.shape && then.jumped == 0;
    if (moves) row.pose = queries::interpolate(row.pose, then.pose, time.fraction);
  }
  return rows;
}

/// Frames with an index. In most of them, an object has the same row as in the frame before.
struct Swept {
  std::vector<RowLists> lists;
  SweptFrames index;

  Swept(std::uint64_t first, const Frames& frames, const geometry::ShapeTable& table) {
    for (std::size_t i = 0; i < frames.size(); ++i) lists.emplace_back(frames[i], i / 3);
    std::vector<queries::FrameRows> views;
    for (const RowLists& of_frame : lists) views.push_back(of_frame.view());
    index.build(first, views, table);
  }
};

/// Asks random queries at random times, together and in small batches, on every target. Returns the number of hits.
std::size_t check_times(const geometry::ShapeTable& table, const Frames& frames, Random& random, int queries) {
  const geometry::ShapeView view = table.view();
  Batch batch;
  for (int i = 0; i < queries; ++i) {
    const double fractions[] = {0, 0, 0.5, random.uniform(0, 1), 0.9999};
    const QueryTime time{static_cast<std::uint32_t>(random.below(frames.size() - 1)), fractions[random.below(5)]};
    batch.times.push_back(time);
    add_random(view, rows_at(frames, time), random, 10, {}, batch);
  }
  test::on_every_target([&] {
    const Swept swept(40, frames, table);
    Searcher searcher;
    const std::size_t all = batch.rays.size();
    check(searcher, swept.index, view, batch, 0, all);
    for (std::size_t i = 0; i < all; i += 10) check(searcher, swept.index, view, batch, i, std::min(i + 10, all));
  });
  std::size_t count = 0;
  for (const auto* lists : {&batch.cast, &batch.swept, &batch.overlapped, &batch.near}) {
    for (const Founds& list : *lists) count += list.size();
  }
  return count;
}

Frames make_frames(std::size_t count, std::size_t objects, double step, Random& random) {
  Frames frames{make_rows(random, objects, 10, {})};
  for (std::uint32_t i = 0; i < objects; ++i) frames[0][i].slot = i;
  while (frames.size() < count) frames.push_back(next_frame(frames.back(), random, step));
  return frames;
}

TEST_CASE("at each time of some frames, a query finds what exact tests of the objects at that time find") {
  Random random(1);
  geometry::ShapeTable table;
  add_shapes(table);
  for (const std::size_t count : {2, 3, 9}) {
    for (const double step : {0.3, 4.0}) {
      CAPTURE(count);
      CAPTURE(step);
      CHECK(check_times(table, make_frames(count, 130, step, random), random, 50) > 50);
    }
  }
}

TEST_CASE("frames have different numbers of slots, and some have no object") {
  Random random(2);
  geometry::ShapeTable table;
  add_shapes(table);
  Frames frames = make_frames(9, 60, 0.5, random);
  frames[0].clear();
  frames[3].resize(20);
  frames[4].clear();
  for (TestObject& row : frames[6]) row.number = 0;
  frames[8].resize(40);
  CHECK(check_times(table, frames, random, 60) > 20);
  CHECK(check_times(table, Frames(3), random, 10) == 0);
}

TEST_CASE("objects that are very far from the others are found") {
  Random random(3);
  geometry::ShapeTable table;
  add_shapes(table);
  Frames frames = make_frames(5, 100, 0.5, random);
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i][7].pose.position = {1e15, static_cast<double>(i) * 1e14, 0};
  frames[1][8].pose.position = {-1e12, 0, 0};
  CHECK(check_times(table, frames, random, 40) > 30);
}

TEST_CASE("the tip of a rod that turns is found between two frames, where it is outside the bounds of both") {
  Random random(4);
  geometry::ShapeTable table;
  const ShapeNumber rod = table.add(Box{{0.01f, 3, 0.01f}});
  const geometry::ShapeView view = table.view();
  for (int i = 0; i < 500; ++i) {
    CAPTURE(i);
    Frames frames(2, std::vector<TestObject>(1));
    const Quat from = random.orientation(), to = random.orientation();
    const double turn = random.uniform(0, 1);
    for (std::size_t k = 0; k < 2; ++k) {
      TestObject& row = frames[k][0];
      row.number = 1, row.generation = 1, row.shape = rod;
      row.pose = k == 0 ? Pose{{}, from} : queries::interpolate({{}, from}, {{1, 0, 0}, to}, turn);
    }
    const Swept swept(0, frames, table);
    const QueryTime time{0, random.uniform(0, 1)};
    const Pose there = queries::interpolate(frames[0][0].pose, frames[1][0].pose, time.fraction);
    const Quat& q = there.orientation;
    const auto axes = geometry::rotation<double>(q.x, q.y, q.z, q.w);
    const Vec3d tip = there.position + Vec3d{axes.m[0][1], axes.m[1][1], axes.m[2][1]} * 2.999;
    ObjectHit hit;
    QueryWork work;
    cast_one(swept.index, {view, {&time, 1}}, Ray::along(tip, {}), hit, work);
    CHECK(hit.object != nullptr);
  }
}

TEST_CASE("the index covers the frames before the last") {
  const Frames frames(4);
  geometry::ShapeTable table;
  CHECK(!SweptFrames().covers(0));
  const Swept made(21, frames, table);
  const SweptFrames& swept = made.index;
  CHECK(!swept.covers(20));
  CHECK(swept.covers(21));
  CHECK(swept.covers(23));
  CHECK(!swept.covers(24));
  CHECK(swept.time(22, 0.25).frame == 1);
  CHECK(swept.time(22, 0.25).fraction == 0.25);
}

TEST_CASE("only the boxes of small stays are searched where an object jumps") {
  geometry::ShapeTable table;
  const ShapeNumber ball = table.add(Sphere{1});
  Frames frames(3, std::vector<TestObject>(1));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    TestObject& row = frames[i][0];
    row.number = 1, row.generation = 1, row.shape = ball;
    row.pose.position = {i == 0 ? -50.0 : 50.0, 0, 0};
  }
  const auto boxes = [&] { return Swept(0, frames, table).index.tree().size(); };
  CHECK(boxes() == 1);
  frames[1][0].jumped = 1;
  CHECK(boxes() == 2);
  frames[1][0].jumped = 0;
  frames[1][0].number = 0;  // it is only in frames 0 and 2, and the last frame cannot be asked about
  CHECK(boxes() == 1);
}

}  // namespace
}  // namespace ringfence::queries_test
