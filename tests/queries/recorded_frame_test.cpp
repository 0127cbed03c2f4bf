#include "queries/recorded_frame.hpp"

#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "queries/one_query.hpp"
#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using queries::RecordedFrame;

using NewRows = RecordedFrame::NewRows;
using SetBounds = std::function<void(const NewRows&, std::uint32_t slot)>;

void add(RecordedFrame& frame, std::uint32_t slot, const TestObject& object, const SetBounds& set_bounds) {
  if (object.number == 0) return;
  const NewRows row = frame.add({&slot, 1});
  row.objects[0] = object;
  row.jumped[0] = object.jumped;
  row.groups[0] = object.group;
  if (set_bounds) set_bounds(row, slot);
}

/// Records the objects of some slots, the last first.
void record(RecordedFrame& frame, std::uint64_t number, const std::vector<TestObject>& objects) {
  frame.begin(objects.size(), true);
  for (auto slot = static_cast<std::uint32_t>(objects.size()); slot-- > 0;) add(frame, slot, objects[slot], {});
  frame.finish(number);
}

TestObject ball(ObjectNumber number, double x) {
  TestObject object;
  object.pose.position = {x, 0, 0};
  object.number = number;
  object.generation = 1;
  return object;
}

template <class Part>
double first_hit(const Part& part, const RecordedFrame& frame, double fraction) {
  queries::ObjectHit best;
  QueryWork work;
  const queries::QueryTime time{0, fraction};
  cast_one(part, {frame.shapes(), {&time, 1}}, narrow_phase::Ray::along({}, {100, 0, 0}), best, work);
  return best.object == nullptr ? -1 : 100 * best.hit.fraction;
}

TEST_CASE("a frame shows the shapes and objects that it was recorded with") {
  const auto shapes = std::make_shared<geometry::ShapeTable>();
  shapes->add(Sphere{1});
  const ShapeNumber second = shapes->add(Sphere{2});
  RecordedFrame frame(shapes, std::make_shared<queries::LastOrder>());
  CHECK(frame.number() == RecordedFrame::none);
  TestObject last = ball(6, 20);
  last.group = 44;
  last.jumped = 1;
  record(frame, 7, {ball(5, 10), TestObject{}, last});
  shapes->remove(second);
  const ShapeNumber third = shapes->add(Sphere{3});
  CHECK(frame.number() == 7);
  CHECK(frame.size() == 2);
  const queries::FrameRows objects = frame.objects();
  CHECK(objects.objects == 2);
  CHECK(objects.rows[objects.row(0)].number == 5);
  CHECK(objects.row(1) == queries::FrameRows::none);
  CHECK(objects.rows[objects.row(2)].number == 6);
  CHECK(objects.group(objects.row(2)) == 44);
  CHECK(objects.has_jumped(objects.row(2)));
  CHECK(!objects.has_jumped(objects.row(0)));
  CHECK(objects.row(3) == queries::FrameRows::none);
  CHECK(frame.has_shape(second));
  CHECK(!frame.has_shape(third));
  CHECK(first_hit(frame.standing(), frame, 0) == doctest::Approx(9));
  record(frame, 8, {ball(5, 30)});
  CHECK(frame.size() == 1);
  CHECK(!frame.has_shape(second));
  CHECK(frame.has_shape(third));
  CHECK(first_hit(frame.standing(), frame, 0) == doctest::Approx(29));
}

TEST_CASE("the index of a frame that is recorded again finds what that of a new one finds") {
  const auto shapes = std::make_shared<geometry::ShapeTable>();
  add_shapes(*shapes);
  const geometry::FixedSpace space({-50, -50, -50}, {50, 50, 50});
  const auto order = std::make_shared<queries::LastOrder>();
  RecordedFrame again(shapes, order);
  Random random(8);
  std::vector<TestObject> objects = make_rows(random, 300, 10, {});
  std::vector<base::FrameStamp> changed(objects.size(), 3);
  std::uint32_t first = 0;  // the slot that is recorded first
  const auto record_in = [&](RecordedFrame& frame, std::uint64_t number, const Vec3d& origin) {
    frame.begin(objects.size(), true);
    frame.begin_bounds(space, origin);
    for (std::uint32_t i = 0; i < objects.size(); ++i) {
      const auto at = static_cast<std::uint32_t>((first + i) % objects.size());
      add(frame, at, objects[at], [&](const NewRows& row, std::uint32_t slot) {
        const TestObject& object = objects[slot];
        row.bounds[0] = {shapes->bounds(object.shape, object.pose, space),
                         queries::margin_of(shapes->row(object.shape))};
        row.changed[0] = changed[slot];
      });
    }
    frame.finish(number);
  };
  for (std::uint64_t number = 3; number < 90; ++number) {
    CAPTURE(number);
    const std::vector<TestObject> drawn = make_rows(random, objects.size(), 10, {});
    // In some frames the rows are in another order, most objects change, or objects appear and disappear.
    if (number % 7 == 0) first = static_cast<std::uint32_t>(random.below(300));
    const std::size_t one_of = number % 6 == 0 ? 1 : 20;
    for (std::uint32_t slot = 0; slot < objects.size(); ++slot) {
      if (random.below(one_of) != 0 || (number % 5 != 0 && (drawn[slot].number == 0) != (objects[slot].number == 0)))
        continue;
      objects[slot] = drawn[slot];
      changed[slot] = static_cast<base::FrameStamp>(number);
    }
    // Far away from time to time, which moves the origin of the index.
    record_in(again, number, number % 9 == 0 ? Vec3d{5000, 0, 0} : Vec3d{});
    RecordedFrame fresh(shapes, std::make_shared<queries::LastOrder>());
    record_in(fresh, number, {});
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
    }
  }
}

TEST_CASE("on the way to the next frame an object moves if it is the same one there, with the same shape") {
  const auto shapes = std::make_shared<geometry::ShapeTable>();
  shapes->add(Sphere{1});
  shapes->add(Sphere{1});
  const auto order = std::make_shared<queries::LastOrder>();
  RecordedFrame now(shapes, order), next(shapes, order);
  record(now, 1, {ball(5, 10)});
  TestObject later = ball(5, 20);
  record(next, 2, {later});
  CHECK(first_hit(now.moving_to(next), now, 0.5) == doctest::Approx(14));
  const auto stands = [&](const std::vector<TestObject>& rows) {
    record(now, 1, {ball(5, 10)});
    record(next, 2, rows);
    CHECK(first_hit(now.moving_to(next), now, 0.5) == doctest::Approx(9));
  };
  stands({TestObject{}});
  stands({});
  later.jumped = 1;
  stands({later});
  later = ball(5, 20);
  later.shape = 1;
  stands({later});
  later = ball(5, 20);
  later.generation = 2;
  stands({later});
  stands({ball(4, 20)});
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
