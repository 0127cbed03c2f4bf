// Searches with the index against exact tests of all objects.
#include "queries/frame_part.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using narrow_phase::QueryShape;
using narrow_phase::Ray;
using narrow_phase::ShapeHit;
using queries::FrameMoment;
using queries::FramePart;
using queries::ObjectHit;
using queries::ObjectPoint;

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
Founds first(const Founds& all) { return all.empty() ? Founds() : Founds{all.front()}; }

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

/// Compares all kinds of queries along one path on every target. `found` counts hits.
void check(const Objects& objects, const FramePart& part, const Vec3d& start, const Vec3d& displacement,
           ShapeNumber shape, const Quat& orientation, double distance, const QueryFilter& filter, std::size_t& count) {
  const geometry::ShapeView view = objects.table.view();
  const FrameMoment moment{view, objects.fraction};
  const Ray ray = Ray::along(start, displacement);
  const QueryShape moving{view, shape, orientation};
  QueryWork work;

  const Founds cast = test_all(objects, filter, [&](const FrameObject& row, const Pose& pose, ShapeHit& hit) {
    return narrow_phase::cast_ray(view, row.shape, pose, ray, 1, hit);
  });
  std::vector<ObjectHit> hits;
  part.cast_all(moment, ray, filter, hits, work);
  CHECK((sorted(hits) == cast));
  ObjectHit best;
  part.cast(moment, ray, filter, best, work);
  CHECK((only(best) == first(cast)));
  CHECK(part.cast_any(moment, ray, filter, work) == !cast.empty());

  const Founds swept = test_all(objects, filter, [&](const FrameObject& row, const Pose& pose, ShapeHit& hit) {
    return narrow_phase::sweep_shape(view, row.shape, pose, moving, ray, 1, hit);
  });
  hits.clear();
  part.sweep_all(moment, moving, ray, filter, hits, work);
  CHECK((sorted(hits) == swept));
  best = {};
  part.sweep(moment, moving, ray, filter, best, work);
  CHECK((only(best) == first(swept)));

  const Founds overlapped = test_all(objects, filter, [&](const FrameObject& row, const Pose& pose, ShapeHit& hit) {
    return narrow_phase::overlaps(view, row.shape, pose, moving, start, hit.triangle);
  });
  hits.clear();
  part.overlap(moment, moving, start, filter, hits, work);
  CHECK((sorted(hits) == overlapped));

  const Founds near = test_all(objects, filter, [&](const FrameObject& row, const Pose& pose, ShapeHit& hit) {
    narrow_phase::NearestPoint point;
    if (!narrow_phase::find_nearest(view, row.shape, pose, start, distance, point)) return false;
    hit.fraction = point.distance;
    hit.point = point.point;
    hit.triangle = point.triangle;
    return true;
  });
  ObjectPoint nearest;
  part.nearest(moment, start, distance, filter, nearest, work);
  const Founds one = nearest.object == nullptr ? Founds()
                                               : Founds{{nearest.nearest.distance,
                                                         nearest.object->number,
                                                         nearest.nearest.point,
                                                         {},
                                                         nearest.nearest.triangle}};
  CHECK((one == first(near)));
  count += cast.size() + swept.size() + overlapped.size() + near.size();
}

/// Random queries about random objects around `origin`, which are within `half` of it. Returns the number of hits.
std::size_t check_many(Objects& objects, Random& random, double half, const Vec3d& origin, int queries) {
  std::size_t count = 0;
  test::on_every_target([&] {
    FramePart part;
    part.build(objects.rows, objects.ends, objects.table);
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
      check(objects, part, start, displacement, shape, random.orientation(), distance, filter, count);
    }
  });
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
    const std::size_t found = check_many(objects, random, world.half, world.origin, 12);
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
  CHECK(check_many(objects, random, 10, {}, 25) > 100);
  FramePart part;
  part.build(objects.rows, {}, objects.table);
  const geometry::ShapeView view = objects.table.view();
  QueryWork work;
  ObjectPoint nearest;
  part.nearest({view}, {1e15, 5e14, 0}, 100, {}, nearest, work);
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
    CHECK(check_many(objects, random, 10, {}, 8) > 50);
  }
}

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
  part.build(objects.rows, {}, objects.table);
  const geometry::ShapeView view = objects.table.view();
  QueryWork work;
  ObjectHit best;
  part.cast({view}, Ray::along({0, 0, 0}, {10, 0, 0}), {}, best, work);
  REQUIRE(best.object != nullptr);
  CHECK(best.object->number == 4);
  CHECK(best.hit.fraction == doctest::Approx(0.4));
  // A hit of another part with the same fraction and a lower number stays.
  FrameObject other = objects.rows[0];
  other.number = 2;
  best.object = &other;
  part.cast({view}, Ray::along({0, 0, 0}, {10, 0, 0}), {}, best, work);
  CHECK(best.object == &other);
}

TEST_CASE("a frame that is divided into parts in any way has the same first hits") {
  Random random(4);
  Objects objects;
  add_shapes(objects.table);
  objects.rows = make_rows(random, 150, 8, {});
  const geometry::ShapeView view = objects.table.view();
  FramePart whole;
  whole.build(objects.rows, {}, objects.table);
  std::vector<std::vector<FrameObject>> rows(3);
  for (const FrameObject& row : objects.rows) rows[random.below(3)].push_back(row);
  std::vector<FramePart> parts(3);
  for (std::size_t i = 0; i < 3; ++i) parts[i].build(rows[i], {}, objects.table);
  QueryWork work;
  for (int i = 0; i < 50; ++i) {
    const Vec3d start = random.in_cube(10), displacement = random.in_cube(20);
    const Ray ray = Ray::along(start, displacement);
    ObjectHit one, best;
    whole.cast({view}, ray, {}, one, work);
    for (const FramePart& part : parts) part.cast({view}, ray, {}, best, work);
    CHECK((only(one) == only(best)));
    ObjectPoint near_one, near_best;
    whole.nearest({view}, start, 5, {}, near_one, work);
    for (const FramePart& part : parts) part.nearest({view}, start, 5, {}, near_best, work);
    CHECK((near_one.object == nullptr) == (near_best.object == nullptr));
    if (near_one.object != nullptr) CHECK(near_one.object->number == near_best.object->number);
  }
}

TEST_CASE("an empty part finds nothing") {
  geometry::ShapeTable table;
  const ShapeNumber ball = table.add(Sphere{1});
  const geometry::ShapeView view = table.view();
  FramePart part;
  part.build(std::vector<FrameObject>(5), {}, table);
  CHECK(part.size() == 0);
  QueryWork work;
  std::vector<ObjectHit> hits;
  part.cast_all({view}, Ray::along({}, {1, 0, 0}), {}, hits, work);
  part.overlap({view}, {view, ball, {}}, {}, {}, hits, work);
  CHECK(hits.empty());
  ObjectPoint nearest;
  part.nearest({view}, {}, 1e9, {}, nearest, work);
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
  part.build(rows, {}, table);
  const geometry::ShapeView view = table.view();
  const Ray ray = Ray::along({}, {20, 0, 0});
  QueryWork work;
  ObjectHit best;
  part.cast({view}, ray, {}, best, work);
  CHECK(best.object->number == 1);
  CHECK(work.failed_supports == 0);
  fails = true;
  best = {};
  part.cast({view}, ray, {}, best, work);
  CHECK(best.object->number == 2);
  CHECK(work.failed_supports == 1);
}

}  // namespace
}  // namespace ringfence::queries_test
