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
  std::vector<TestObject> rows;  ///< by key
};

/// Asks random queries together and in batches that are too small for that, on every target. Returns the number of
/// hits.
std::size_t check_many(Objects& objects, Random& random, double half, const Vec3d& origin, int queries) {
  const geometry::ShapeView view = objects.table.view();
  Batch batch;
  for (int i = 0; i < queries; ++i) add_random(view, objects.rows, random, half, origin, batch);
  test::on_every_target([&] {
    const RowLists lists(objects.rows);
    FramePart part;
    part.build(lists.view(), objects.table);
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
  for (TestObject& row : objects.rows) {
    if (row.number == 0 || row.slot % 20 != 3) continue;
    row.pose.position.x = far % 2 == 0 ? 1e15 : -1e15;
    row.pose.position.y = 5e14;
    ++far;
  }
  REQUIRE(far > 3);
  CHECK(check_many(objects, random, 10, {}, 60) > 100);
  const RowLists lists(objects.rows);
  FramePart part;
  part.build(lists.view(), objects.table);
  const geometry::ShapeView view = objects.table.view();
  QueryWork work;
  ObjectPoint nearest;
  find_one(part, {view}, {1e15, 5e14, 0}, 100, nearest, work);
  CHECK(nearest.object != nullptr);
}

/// The bounds of all rows in the space of a world.
std::vector<queries::RowBounds> bounds_of(const RowLists& lists, const geometry::ShapeTable& table,
                                          const geometry::FixedSpace& space) {
  return lists.each<queries::RowBounds>([&](const FrameObject& row) -> queries::RowBounds {
    return {table.bounds(row.shape, row.pose, space), queries::margin_of(table.row(row.shape))};
  });
}

void check_orders_of_frames(bool known) {
  Random random(6);
  // Some of the objects are outside.
  const geometry::FixedSpace space({-30, -40, -40}, {40, 40, 10}, geometry::Outside::has_octaves);
  const queries::BoxConverter box_of(space, {1, 2, 3});
  Objects objects;
  add_shapes(objects.table);
  objects.rows = make_rows(random, 2000, 40, {});
  for (std::uint32_t slot = 0; slot < objects.rows.size(); ++slot) {
    objects.rows[slot].slot = slot;
    objects.rows[slot].user_data = slot;
  }
  const geometry::ShapeView view = objects.table.view();
  std::shared_ptr<const queries::TreeOrder> order;
  FramePart again;  // keeps its order itself
  std::vector<base::FrameStamp> changed(objects.rows.size(), 0);
  std::size_t sorted = 0;
  for (std::uint32_t frame = 0; frame < 16; ++frame) {
    CAPTURE(frame);
    FramePart part;
    const RowLists lists(objects.rows, frame / 3);
    const std::vector<queries::RowBounds> bounds = bounds_of(lists, objects.table, space);
    const std::vector<base::FrameStamp> stamps =
        lists.each<base::FrameStamp>([&](const FrameObject& row) { return changed[row.user_data]; });
    queries::KnownBounds given;
    if (known) given = {bounds, &box_of, stamps, {}};
    part.build(lists.view(), objects.table, given, order);
    CHECK(part.size() == count_of(objects.rows));
    if (frame == 0 || order == nullptr) ++sorted;
    order = part.share_order();
    Searcher searcher;
    Batch batch;
    for (int i = 0; i < 40; ++i) add_random(view, objects.rows, random, 40, {}, batch);
    check(searcher, part, view, batch, 0, 40);
    if (known && frame != 0) given.built = frame - 1;
    again.build_again(lists.view(), objects.table, given);
    CHECK(again.size() == count_of(objects.rows));
    check(searcher, again, view, batch, 0, 40);
    for (TestObject& row : objects.rows) {
      if (frame % 4 != 0 && random.below(10) != 0) continue;  // in most frames, most objects rest
      const Vec3d step = random.in_cube(frame < 6 ? 0.1 : 4);
      const Vec3d& at = row.pose.position;
      row.pose.position = {at.x + step.x, at.y + step.y, at.z + step.z};
      if (random.below(300) == 0) row.number = row.number == 0 ? row.slot + 1 : 0;
      changed[row.slot] = frame + 1;
    }
    if (frame == 12) objects.rows.resize(objects.rows.size() / 2);
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
    TestObject row;
    row.pose.position = {5, 0, 0};
    row.number = number;
    row.generation = static_cast<std::uint32_t>(objects.rows.size() + 1);
    row.shape = ball;
    row.slot = static_cast<std::uint32_t>(objects.rows.size());
    objects.rows.push_back(row);
  }
  const RowLists lists(objects.rows);
  FramePart part;
  part.build(lists.view(), objects.table);
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
  const RowLists lists(objects.rows);
  FramePart whole;
  whole.build(lists.view(), objects.table);
  std::vector<std::vector<TestObject>> rows(3);
  for (const TestObject& row : objects.rows) rows[random.below(3)].push_back(row);
  const RowLists of_parts[] = {RowLists(rows[0]), RowLists(rows[1]), RowLists(rows[2])};
  std::vector<FramePart> parts(3);
  for (std::size_t i = 0; i < 3; ++i) parts[i].build(of_parts[i].view(), objects.table);
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
  const RowLists lists(std::vector<TestObject>(5));
  FramePart part;
  part.build(lists.view(), table);
  CHECK(part.size() == 0);
  QueryWork work;
  Searcher searcher;
  for (const std::size_t count : {1u, 100u}) {
    Lists found(count);
    const std::vector<AskedRay> rays(count, {Ray::along({}, {1, 0, 0}), {}});
    const std::vector<AskedShape> balls(count, {{view, ball, {}}, {}, {}});
    searcher.cast_all(part, {view}, rays, found, work);
    searcher.overlap(part, {view}, balls, found, work);
    for (const auto& list : found.of) CHECK(list.empty());
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
  std::vector<TestObject> rows(2);
  rows[0].shape = broken, rows[0].number = 1, rows[0].pose.position = {5, 0, 0};
  rows[1].shape = ball, rows[1].number = 2, rows[1].pose.position = {9, 0, 0};
  const RowLists lists(rows);
  FramePart part;
  part.build(lists.view(), table);
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
