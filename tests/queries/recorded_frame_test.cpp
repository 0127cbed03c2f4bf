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
  frame.begin(rows.size());
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
