// Searches with the index against exact tests of all objects.
#include "queries/searcher.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "queries/one_query.hpp"
#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using narrow_phase::QueryShape;
using narrow_phase::Ray;
using narrow_phase::ShapeHit;
using queries::AskedPoint;
using queries::AskedRay;
using queries::AskedShape;
using queries::FrameMoment;
using queries::FramePart;
using queries::ObjectHit;
using queries::ObjectPoint;
using queries::Searcher;

/// Objects that stand, or that are on their way.
struct Objects {
  geometry::ShapeTable table;
  std::vector<FrameObject> rows;
  std::vector<Pose> ends;
  double fraction = 0;

  Pose pose(std::size_t i) const {
    return ends.empty() ? rows[i].pose : queries::interpolate(rows[i].pose, ends[i], fraction);
  }
};

std::size_t count_of(const std::vector<FrameObject>& rows) {
  return static_cast<std::size_t>(
      std::count_if(rows.begin(), rows.end(), [](const FrameObject& row) { return row.number != 0; }));
}

/// What a query finds, in order of (fraction, number), as comparable numbers.
struct Found {
  double place;
  ObjectNumber number;
  Vec3d point, normal;
  std::uint32_t triangle;
  bool operator==(const Found&) const = default;
  bool operator<(const Found& other) const {
    return place < other.place || (place == other.place && number < other.number);
  }
};
using Founds = std::vector<Found>;

Found found(const FrameObject& object, const ShapeHit& hit) {
  return {hit.fraction, object.number, hit.point, hit.normal, hit.triangle};
}
Founds sorted(const std::vector<ObjectHit>& hits) {
  Founds out;
  for (const ObjectHit& hit : hits) out.push_back(found(*hit.object, hit.hit));
  std::sort(out.begin(), out.end());
  return out;
}
Founds only(const ObjectHit& hit) { return hit.object == nullptr ? Founds() : Founds{found(*hit.object, hit.hit)}; }
Founds first_of(const Founds& all) { return all.empty() ? Founds() : Founds{all.front()}; }

/// `test(row, pose, hit)` of every object that the filter admits.
template <class Test>
Founds test_all(const Objects& objects, const QueryFilter& filter, Test test) {
  Founds out;
  for (std::size_t i = 0; i < objects.rows.size(); ++i) {
    const FrameObject& row = objects.rows[i];
    ShapeHit hit;
    if (row.number != 0 && queries::admits(filter, row) && test(row, objects.pose(i), hit)) {
      out.push_back(found(row, hit));
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// Queries, and what exact tests of all objects say.
struct Batch {
  std::vector<AskedRay> rays;
  std::vector<AskedShape> shapes;
  std::vector<AskedPoint> points;
  std::vector<Founds> cast, swept, overlapped, near;
};

/// Adds all kinds of queries along one path.
void add(const Objects& objects, const Vec3d& start, const Vec3d& displacement, ShapeNumber shape,
         const Quat& orientation, double distance, const QueryFilter& filter, Batch& batch) {
  const geometry::ShapeView view = objects.table.view();
  const Ray ray = Ray::along(start, displacement);
  const QueryShape moving{view, shape, orientation};
  batch.rays.push_back({ray, filter});
  batch.shapes.push_back({moving, ray, filter});
  batch.points.push_back({start, distance, filter});
  batch.cast.push_back(test_all(objects, filter, [&](const FrameObject& row, const Pose& pose, ShapeHit& hit) {
    return narrow_phase::cast_ray(view, row.shape, pose, ray, 1, hit);
  }));
  batch.swept.push_back(test_all(objects, filter, [&](const FrameObject& row, const Pose& pose, ShapeHit& hit) {
    return narrow_phase::sweep_shape(view, row.shape, pose, moving, ray, 1, hit);
  }));
  batch.overlapped.push_back(test_all(objects, filter, [&](const FrameObject& row, const Pose& pose, ShapeHit& hit) {
    return narrow_phase::overlaps(view, row.shape, pose, moving, start, hit.triangle);
  }));
  batch.near.push_back(test_all(objects, filter, [&](const FrameObject& row, const Pose& pose, ShapeHit& hit) {
    narrow_phase::NearestPoint point;
    if (!narrow_phase::find_nearest(view, row.shape, pose, start, distance, point)) return false;
    hit.fraction = point.distance;
    hit.point = point.point;
    hit.triangle = point.triangle;
    return true;
  }));
}

Founds only(const ObjectPoint& found) {
  if (found.object == nullptr) return {};
  const narrow_phase::NearestPoint& nearest = found.nearest;
  return {{nearest.distance, found.object->number, nearest.point, {}, nearest.triangle}};
}

/// Compares the answers of one searcher to queries `first` to `end - 1` of a batch, asked together.
void check(Searcher& searcher, const FramePart& part, const FrameMoment& moment, const Batch& batch, std::size_t first,
           std::size_t end) {
  const std::size_t count = end - first;
  const std::span rays = std::span(batch.rays).subspan(first, count);
  const std::span shapes = std::span(batch.shapes).subspan(first, count);
  const std::span points = std::span(batch.points).subspan(first, count);
  QueryWork work;
  std::vector<ObjectHit> cast(count), swept(count);
  std::vector<ObjectPoint> near(count);
  const auto any = std::make_unique<bool[]>(count);
  Lists cast_all(count), swept_all(count), overlapped(count);
  searcher.cast(part, moment, rays, cast, work);
  searcher.cast_any(part, moment, rays, {any.get(), count}, work);
  searcher.cast_all(part, moment, rays, cast_all, work);
  searcher.sweep(part, moment, shapes, swept, work);
  searcher.sweep_all(part, moment, shapes, swept_all, work);
  searcher.overlap(part, moment, shapes, overlapped, work);
  searcher.nearest(part, moment, points, near, work);
  CHECK(work.failed_supports == 0);
  for (std::size_t i = 0; i < count; ++i) {
    CAPTURE(i);
    CHECK((only(cast[i]) == first_of(batch.cast[first + i])));
    CHECK(any[i] == !batch.cast[first + i].empty());
    CHECK((sorted(cast_all.of[i]) == batch.cast[first + i]));
    CHECK((only(swept[i]) == first_of(batch.swept[first + i])));
    CHECK((sorted(swept_all.of[i]) == batch.swept[first + i]));
    CHECK((sorted(overlapped.of[i]) == batch.overlapped[first + i]));
    CHECK((only(near[i]) == first_of(batch.near[first + i])));
  }
}

/// Random queries about random objects around `origin`, which are within `half` of it.
Batch make_batch(const Objects& objects, Random& random, double half, const Vec3d& origin, int queries) {
  Batch batch;
  for (int i = 0; i < queries; ++i) {
    const double lengths[] = {0, 1, half, 4 * half, 1e6};
    const Vec3d offset = random.in_cube(1.2 * half);
    const Vec3d start = random.below(4) == 0 ? objects.rows[random.below(objects.rows.size())].pose.position
                                             : Vec3d{origin.x + offset.x, origin.y + offset.y, origin.z + offset.z};
    Vec3d displacement = random.in_cube(lengths[random.below(5)]);
    if (random.below(6) == 0) displacement.x = displacement.y = 0;  // along an axis
    QueryFilter filter;
    if (random.below(4) == 0) filter.layers = static_cast<std::uint32_t>(random.below(32));
    if (random.below(4) == 0) filter.categories = static_cast<std::uint32_t>(random.below(16));
    if (random.below(4) == 0) filter.except_group = static_cast<std::uint32_t>(random.below(4));
    const FrameObject& except = objects.rows[random.below(objects.rows.size())];
    if (random.below(2) == 0) filter.except = ObjectId::of(except.number, except.generation);
    const double distance = random.below(3) == 0 ? std::numeric_limits<double>::infinity() : random.uniform(0, half);
    const auto shape = static_cast<ShapeNumber>(random.below(mesh_shape));
    add(objects, start, displacement, shape, random.orientation(), distance, filter, batch);
  }
  return batch;
}

/// Asks random queries together and in batches that are too small for that, on every target. Returns the number of
/// hits.
std::size_t check_many(Objects& objects, Random& random, double half, const Vec3d& origin, int queries) {
  const Batch batch = make_batch(objects, random, half, origin, queries);
  const geometry::ShapeView view = objects.table.view();
  test::on_every_target([&] {
    FramePart part;
    part.build(objects.rows, count_of(objects.rows), objects.ends, objects.table);
    Searcher searcher;
    const std::size_t all = batch.rays.size();
    check(searcher, part, {view, objects.fraction}, batch, 0, all);
    for (std::size_t i = 0; i < all; i += 10) {
      check(searcher, part, {view, objects.fraction}, batch, i, std::min(i + 10, all));
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
  part.build(objects.rows, count_of(objects.rows), {}, objects.table);
  const geometry::ShapeView view = objects.table.view();
  QueryWork work;
  ObjectPoint nearest;
  find_one(part, {view}, {1e15, 5e14, 0}, 100, nearest, work);
  CHECK(nearest.object != nullptr);
}

TEST_CASE("objects on their way are found where they are at each fraction") {
  Random random(3);
  Objects objects;
  add_shapes(objects.table);
  objects.rows = make_rows(random, 120, 10, {});
  for (const FrameObject& row : objects.rows) {
    const Vec3d step = random.in_cube(random.below(5) == 0 ? 8 : 0.5);
    const Vec3d& from = row.pose.position;
    objects.ends.push_back({{from.x + step.x, from.y + step.y, from.z + step.z}, random.orientation()});
  }
  for (const double fraction : {0.0, 0.25, 0.5, 0.999, 1.0}) {
    CAPTURE(fraction);
    objects.fraction = fraction;
    CHECK(check_many(objects, random, 10, {}, 40) > 50);
  }
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
    part.build(objects.rows, count_of(objects.rows), {}, objects.table, given, order);
    CHECK(part.size() == count_of(objects.rows));
    if (frame == 0 || order == nullptr) ++sorted;
    order = part.share_order();
    Searcher searcher;
    const Batch batch = make_batch(objects, random, 40, {}, 40);
    check(searcher, part, {view}, batch, 0, 40);
    again.build_again(objects.rows, count_of(objects.rows), objects.table, given);
    CHECK(again.size() == count_of(objects.rows));
    check(searcher, again, {view}, batch, 0, 40);
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
  part.build(objects.rows, count_of(objects.rows), {}, objects.table);
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
  whole.build(objects.rows, count_of(objects.rows), {}, objects.table);
  std::vector<std::vector<FrameObject>> rows(3);
  for (const FrameObject& row : objects.rows) rows[random.below(3)].push_back(row);
  std::vector<FramePart> parts(3);
  for (std::size_t i = 0; i < 3; ++i) parts[i].build(rows[i], count_of(rows[i]), {}, objects.table);
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
  part.build(std::vector<FrameObject>(5), 0, {}, table);
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
  part.build(rows, count_of(rows), {}, table);
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
