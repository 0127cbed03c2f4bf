// Searches with the index against exact tests of all objects.
#include "queries/searcher.hpp"

#include <algorithm>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "queries/exact_answers.hpp"

namespace ringfence::queries_test {
namespace {

using queries::FramePart;

struct Objects {
  geometry::ShapeTable table;
  std::vector<FrameObject> rows;
};

/// Asks random queries together and in batches that are too small for that, on every target. Returns the number of
/// hits.
std::size_t check_many(Objects& objects, Random& random, double half, const Vec3d& origin, int queries) {
  const geometry::ShapeView view = objects.table.view();
  Batch batch;
  for (int i = 0; i < queries; ++i) add_random(view, objects.rows, random, half, origin, batch);
  test::on_every_target([&] {
    FramePart part;
    part.build(objects.rows, count_of(objects.rows), objects.table);
    Searcher searcher;
    const std::size_t all = batch.rays.size();
    check(searcher, part, view, batch, 0, all);
    for (std::size_t i = 0; i < all; i += 10) {
      check(searcher, part, view, batch, i, std::min(i + 10, all));
    }
  });
  std::size_t count = 0;
  for (const auto* lists : {&batch.cast, &batch.swept, &batch.overlapped, &batch.near}) {
    for (const Founds& list : *lists) count += list.size();
  }
  return count;
}

TEST_CASE("the index finds what exact tests of all objects find, on every target") {
  struct World {
    std::size_t objects;
    double half;
    Vec3d origin;
  };
  const World worlds[] = {{200, 12, {}},
                          {200, 2, {}},  // all overlap
                          {9, 8, {}},
                          {1, 1, {}},
                          {150, 12, {1e6, -1e6, 3e5}},  // rounding errors of floats are 0.06 m
                          {60, 12, {1e12, 0, -1e12}}};
  Random random(1);
  for (const World& world : worlds) {
    CAPTURE(world.objects);
    CAPTURE(world.origin.x);
    Objects objects;
    add_shapes(objects.table);
    objects.rows = make_rows(random, world.objects, world.half, world.origin);
    objects.rows[0].number = 1;
    const std::size_t found = check_many(objects, random, world.half, world.origin, 60);
    CHECK((found > 0 || world.objects == 1));
  }
}

TEST_CASE("objects that are very far from the others do not hide them, and are found") {
  Random random(2);
  Objects objects;
  add_shapes(objects.table);
  objects.rows = make_rows(random, 120, 10, {});
  std::size_t far = 0;
  for (FrameObject& row : objects.rows) {
    if (row.number == 0 || row.slot % 20 != 3) continue;
    row.pose.position.x = far % 2 == 0 ? 1e15 : -1e15;
    row.pose.position.y = 5e14;
    ++far;
  }
  REQUIRE(far > 3);
  CHECK(check_many(objects, random, 10, {}, 60) > 100);
  FramePart part;
  part.build(objects.rows, count_of(objects.rows), objects.table);
  const geometry::ShapeView view = objects.table.view();
  QueryWork work;
  ObjectPoint nearest;
  find_one(part, {view}, {1e15, 5e14, 0}, 100, nearest, work);
  CHECK(nearest.object != nullptr);
}

/// The bounds of all rows in the space of a world.
std::vector<queries::RowBounds> bounds_of(const Objects& objects, const geometry::FixedSpace& space) {
  std::vector<queries::RowBounds> bounds;
  for (const FrameObject& row : objects.rows) {
    if (row.number == 0) {
      bounds.push_back({{}, -1});
    } else {
      bounds.push_back(
          {objects.table.bounds(row.shape, row.pose, space), queries::margin_of(objects.table.row(row.shape))});
    }
  }
  return bounds;
}

void check_orders_of_frames(bool known) {
  Random random(6);
  // Some of the objects are outside.
  const geometry::FixedSpace space({-30, -40, -40}, {40, 40, 10}, geometry::Outside::has_octaves);
  const queries::BoxConverter box_of(space, {1, 2, 3});
  Objects objects;
  add_shapes(objects.table);
  objects.rows = make_rows(random, 2000, 40, {});
  const geometry::ShapeView view = objects.table.view();
  std::shared_ptr<const queries::TreeOrder> order;
  FramePart again;  // keeps its order itself
  std::size_t sorted = 0;
  for (int frame = 0; frame < 12; ++frame) {
    CAPTURE(frame);
    FramePart part;
    const std::vector<queries::RowBounds> bounds = bounds_of(objects, space);
    const queries::KnownBounds given{known ? std::span(bounds) : std::span<const queries::RowBounds>(), &box_of};
    part.build(objects.rows, count_of(objects.rows), objects.table, given, order);
    CHECK(part.size() == count_of(objects.rows));
    if (frame == 0 || order == nullptr) ++sorted;
    order = part.share_order();
    Searcher searcher;
    Batch batch;
    for (int i = 0; i < 40; ++i) add_random(view, objects.rows, random, 40, {}, batch);
    check(searcher, part, view, batch, 0, 40);
    again.build_again(objects.rows, count_of(objects.rows), objects.table, given);
    CHECK(again.size() == count_of(objects.rows));
    check(searcher, again, view, batch, 0, 40);
    for (FrameObject& row : objects.rows) {
      const Vec3d step = random.in_cube(frame < 6 ? 0.1 : 4);
      const Vec3d& at = row.pose.position;
      row.pose.position = {at.x + step.x, at.y + step.y, at.z + step.z};
      if (random.below(300) == 0) row.number = row.number == 0 ? row.slot + 1 : 0;
    }
    if (frame == 8) objects.rows.resize(objects.rows.size() / 2);
  }
  CHECK(sorted > 1);
  CHECK(sorted < 8);
}

TEST_CASE("the order of an earlier frame serves while objects move, appear and disappear; then they are sorted again") {
  check_orders_of_frames(false);
}

TEST_CASE("the same with bounds that the world has computed") { check_orders_of_frames(true); }

TEST_CASE("of objects that are hit at the same place, the one with the lowest number counts") {
  Objects objects;
  const ShapeNumber ball = objects.table.add(Sphere{1});
  for (const ObjectNumber number : {9u, 4u, 7u, 4u, 12u}) {
    FrameObject row;
    row.pose.position = {5, 0, 0};
    row.number = number;
    row.generation = static_cast<std::uint32_t>(objects.rows.size() + 1);
    row.shape = ball;
    row.slot = static_cast<std::uint32_t>(objects.rows.size());
    objects.rows.push_back(row);
  }
  FramePart part;
  part.build(objects.rows, count_of(objects.rows), objects.table);
  const geometry::ShapeView view = objects.table.view();
  QueryWork work;
  ObjectHit best;
  cast_one(part, {view}, Ray::along({0, 0, 0}, {10, 0, 0}), best, work);
  REQUIRE(best.object != nullptr);
  CHECK(best.object->number == 4);
  CHECK(best.hit.fraction == doctest::Approx(0.4));
  // A hit of another part with the same fraction and a lower number stays.
  FrameObject other = objects.rows[0];
  other.number = 2;
  best.object = &other;
  cast_one(part, {view}, Ray::along({0, 0, 0}, {10, 0, 0}), best, work);
  CHECK(best.object == &other);
}

TEST_CASE("a frame that is divided into parts in any way has the same first hits") {
  Random random(4);
  Objects objects;
  add_shapes(objects.table);
  objects.rows = make_rows(random, 150, 8, {});
  const geometry::ShapeView view = objects.table.view();
  FramePart whole;
  whole.build(objects.rows, count_of(objects.rows), objects.table);
  std::vector<std::vector<FrameObject>> rows(3);
  for (const FrameObject& row : objects.rows) rows[random.below(3)].push_back(row);
  std::vector<FramePart> parts(3);
  for (std::size_t i = 0; i < 3; ++i) parts[i].build(rows[i], count_of(rows[i]), objects.table);
  QueryWork work;
  for (int i = 0; i < 50; ++i) {
    const Vec3d start = random.in_cube(10), displacement = random.in_cube(20);
    const Ray ray = Ray::along(start, displacement);
    ObjectHit one, best;
    cast_one(whole, {view}, ray, one, work);
    for (const FramePart& part : parts) cast_one(part, {view}, ray, best, work);
    CHECK((only(one) == only(best)));
    ObjectPoint near_one, near_best;
    find_one(whole, {view}, start, 5, near_one, work);
    for (const FramePart& part : parts) find_one(part, {view}, start, 5, near_best, work);
    CHECK((near_one.object == nullptr) == (near_best.object == nullptr));
    if (near_one.object != nullptr) CHECK(near_one.object->number == near_best.object->number);
  }
}

TEST_CASE("an empty part finds nothing") {
  geometry::ShapeTable table;
  const ShapeNumber ball = table.add(Sphere{1});
  const geometry::ShapeView view = table.view();
  FramePart part;
  part.build(std::vector<FrameObject>(5), 0, table);
  CHECK(part.size() == 0);
  QueryWork work;
  Searcher searcher;
  for (const std::size_t count : {1u, 100u}) {
    Lists lists(count);
    const std::vector<AskedRay> rays(count, {Ray::along({}, {1, 0, 0}), {}});
    const std::vector<AskedShape> balls(count, {{view, ball, {}}, {}, {}});
    searcher.cast_all(part, {view}, rays, lists, work);
    searcher.overlap(part, {view}, balls, lists, work);
    for (const auto& list : lists.of) CHECK(list.empty());
  }
  ObjectPoint nearest;
  find_one(part, {view}, {}, 1e9, nearest, work);
  CHECK(nearest.object == nullptr);
}

/// A ball whose function fails once `fails` is set.
class FailingSupport final : public SupportFunction {
 public:
  explicit FailingSupport(const bool& fails) : fails_(fails) {}
  Vec3f support(Vec3f direction) const override {
    if (fails_) throw 7;
    return ball_.support(direction);
  }

 private:
  test::Ellipsoid ball_{{1, 1, 1}};
  const bool& fails_;
};

TEST_CASE("an object whose support function fails is left out and counted, and others are found") {
  bool fails = false;
  geometry::ShapeTable table;
  const ShapeNumber broken = table.add(SupportShape{std::make_shared<FailingSupport>(fails)});
  const ShapeNumber ball = table.add(Sphere{1});
  std::vector<FrameObject> rows(2);
  rows[0].shape = broken, rows[0].number = 1, rows[0].pose.position = {5, 0, 0};
  rows[1].shape = ball, rows[1].number = 2, rows[1].pose.position = {9, 0, 0};
  FramePart part;
  part.build(rows, count_of(rows), table);
  const geometry::ShapeView view = table.view();
  const Ray ray = Ray::along({}, {20, 0, 0});
  QueryWork work;
  ObjectHit best;
  cast_one(part, {view}, ray, best, work);
  CHECK(best.object->number == 1);
  CHECK(work.failed_supports == 0);
  fails = true;
  best = {};
  cast_one(part, {view}, ray, best, work);
  CHECK(best.object->number == 2);
  CHECK(work.failed_supports == 1);
}

}  // namespace
}  // namespace ringfence::queries_test
