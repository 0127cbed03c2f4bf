#include "queries/recorded_frame.hpp"

#include <algorithm>
#include <memory>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "queries/one_query.hpp"
#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using queries::RecordedFrame;

void record(RecordedFrame& frame, std::uint64_t number, const std::vector<FrameObject>& rows) {
  (void)frame.begin(rows.size(), number);
  for (std::uint32_t i = 0; i < rows.size(); ++i) {
    frame.row(i) = rows[i];
    frame.set_user_data(i, 100 + i);
  }
  frame.finish(number, static_cast<std::size_t>(std::count_if(rows.begin(), rows.end(),
                                                              [](const FrameObject& row) { return row.number != 0; })));
}

FrameObject ball(ObjectNumber number, std::uint32_t slot, double x) {
  FrameObject row;
  row.pose.position = {x, 0, 0};
  row.number = number;
  row.generation = 1;
  row.slot = slot;
  return row;
}

template <class Part>
double first_hit(const Part& part, const RecordedFrame& frame, double fraction) {
  queries::ObjectHit best;
  QueryWork work;
  const queries::QueryTime time{0, fraction};
  cast_one(part, {frame.shapes(), {&time, 1}}, narrow_phase::Ray::along({}, {100, 0, 0}), best, work);
  return best.object == nullptr ? -1 : 100 * best.hit.fraction;
}

TEST_CASE("a frame shows the shapes, objects and user data that it was recorded with") {
  const auto shapes = std::make_shared<geometry::ShapeTable>();
  shapes->add(Sphere{1});
  const ShapeNumber second = shapes->add(Sphere{2});
  RecordedFrame frame(shapes, std::make_shared<queries::LastOrder>());
  CHECK(frame.number() == RecordedFrame::none);
  record(frame, 7, {ball(5, 0, 10), FrameObject{}, ball(6, 2, 20)});
  shapes->remove(second);
  const ShapeNumber third = shapes->add(Sphere{3});
  CHECK(frame.number() == 7);
  CHECK(frame.size() == 2);
  CHECK(frame.user_data(2) == 102);
  CHECK(frame.has_shape(second));
  CHECK(!frame.has_shape(third));
  CHECK(first_hit(frame.standing(), frame, 0) == doctest::Approx(9));
  record(frame, 8, {ball(5, 0, 30)});
  CHECK(frame.size() == 1);
  CHECK(!frame.has_shape(second));
  CHECK(frame.has_shape(third));
  CHECK(first_hit(frame.standing(), frame, 0) == doctest::Approx(29));
}

TEST_CASE("a frame that is recorded again keeps the rows that are not set, and finds what a new one finds") {
  const auto shapes = std::make_shared<geometry::ShapeTable>();
  add_shapes(*shapes);
  const geometry::FixedSpace space({-50, -50, -50}, {50, 50, 50});
  const auto order = std::make_shared<queries::LastOrder>();
  RecordedFrame again(shapes, order);
  Random random(8);
  std::vector<FrameObject> rows = make_rows(random, 300, 10, {});
  const auto set = [&](RecordedFrame& frame, std::uint32_t slot) {
    const FrameObject& row = frame.row(slot) = rows[slot];
    frame.set_user_data(slot, row.number);
    const bool any = row.number != 0;
    frame.set_bounds(slot, any ? queries::RowBounds{shapes->bounds(row.shape, row.pose, space),
                                                    queries::margin_of(shapes->row(row.shape))}
                               : queries::RowBounds{{}, -1});
  };
  for (std::uint64_t number = 3; number < 30; ++number) {
    CAPTURE(number);
    // Far away from time to time, which moves the origin of the index.
    const Vec3d origin = number % 9 == 0 ? Vec3d{5000, 0, 0} : Vec3d{};
    CHECK(again.begin(rows.size(), number) == (number == 3 ? RecordedFrame::none : number - 1));
    again.begin_bounds(space, origin);
    const std::vector<FrameObject> drawn = make_rows(random, rows.size(), 10, {});
    for (std::uint32_t slot = 0; slot < rows.size(); ++slot) {
      if (number != 3 && random.below(20) != 0) continue;
      if (number != 3) rows[slot] = drawn[slot];
      set(again, slot);
    }
    const auto objects = static_cast<std::size_t>(
        std::count_if(rows.begin(), rows.end(), [](const FrameObject& row) { return row.number != 0; }));
    again.finish(number, objects);
    RecordedFrame fresh(shapes, std::make_shared<queries::LastOrder>());
    (void)fresh.begin(rows.size(), number);
    fresh.begin_bounds(space, {});
    for (std::uint32_t slot = 0; slot < rows.size(); ++slot) set(fresh, slot);
    fresh.finish(number, objects);
    if (number % 4 == 0) continue;  // no query, so no index of this frame
    for (int i = 0; i < 40; ++i) {
      const narrow_phase::Ray ray = narrow_phase::Ray::along(random.in_cube(15), random.in_cube(30));
      queries::ObjectHit found, right;
      QueryWork work;
      const queries::QueryTime present{};
      cast_one(again.standing(), {again.shapes(), {&present, 1}}, ray, found, work);
      cast_one(fresh.standing(), {fresh.shapes(), {&present, 1}}, ray, right, work);
      REQUIRE((found.object == nullptr) == (right.object == nullptr));
      if (found.object == nullptr) continue;
      REQUIRE(found.object->number == right.object->number);
      REQUIRE(found.hit.fraction == right.hit.fraction);
      REQUIRE(again.user_data(found.object->slot) == found.object->number);
    }
  }
  CHECK(again.begin(rows.size() - 1, 31) == RecordedFrame::none);
}

TEST_CASE("on the way to the next frame an object moves if it is the same one there, with the same shape") {
  const auto shapes = std::make_shared<geometry::ShapeTable>();
  shapes->add(Sphere{1});
  shapes->add(Sphere{1});
  const auto order = std::make_shared<queries::LastOrder>();
  RecordedFrame now(shapes, order), next(shapes, order);
  record(now, 1, {ball(5, 0, 10)});
  FrameObject later = ball(5, 0, 20);
  record(next, 2, {later});
  CHECK(first_hit(now.moving_to(next), now, 0.5) == doctest::Approx(14));
  const auto stands = [&](const std::vector<FrameObject>& rows) {
    record(now, 1, {ball(5, 0, 10)});
    record(next, 2, rows);
    CHECK(first_hit(now.moving_to(next), now, 0.5) == doctest::Approx(9));
  };
  stands({FrameObject{}});
  stands({});
  later.jumped = 1;
  stands({later});
  later = ball(5, 0, 20);
  later.shape = 1;
  stands({later});
  later = ball(5, 0, 20);
  later.generation = 2;
  stands({later});
  stands({ball(4, 0, 20)});
}

TEST_CASE("threads that ask first build an index once and find the same") {
  const auto shapes = std::make_shared<geometry::ShapeTable>();
  add_shapes(*shapes);
  Random random(3);
  for (int round = 0; round < 20; ++round) {
    const auto order = std::make_shared<queries::LastOrder>();
    RecordedFrame now(shapes, order), next(shapes, order);
    record(now, 1, make_rows(random, 50, 10, {}));
    record(next, 2, make_rows(random, 50, 10, {}));
    std::vector<double> found(8);
    std::vector<std::thread> threads;
    for (std::size_t i = 0; i < found.size(); ++i) {
      threads.emplace_back(
          [&, i] { found[i] = first_hit(now.standing(), now, 0) + 1000 * first_hit(now.moving_to(next), now, 0.5); });
    }
    for (std::thread& thread : threads) thread.join();
    for (const double value : found) CHECK(value == found[0]);
  }
}

TEST_CASE("a frame is pinned as long as one reader has pinned it") {
  RecordedFrame frame(std::make_shared<geometry::ShapeTable>(), std::make_shared<queries::LastOrder>());
  CHECK(!frame.is_pinned());
  frame.pin();
  frame.pin();
  frame.unpin();
  CHECK(frame.is_pinned());
  frame.unpin();
  CHECK(!frame.is_pinned());
}

}  // namespace
}  // namespace ringfence::queries_test
