#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include "queries/one_query.hpp"
#include "queries/random_rows.hpp"

// What queries find by exact tests of all objects: the oracle of searches with an index.

namespace ringfence::queries_test {

using narrow_phase::QueryShape;
using narrow_phase::Ray;
using narrow_phase::ShapeHit;
using queries::AskedPoint;
using queries::AskedRay;
using queries::AskedShape;
using queries::ObjectHit;
using queries::ObjectPoint;
using queries::Searcher;

inline std::size_t count_of(const std::vector<TestObject>& rows) {
  return static_cast<std::size_t>(
      std::count_if(rows.begin(), rows.end(), [](const TestObject& row) { return row.number != 0; }));
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

inline Found found(const FrameObject& object, const ShapeHit& hit) {
  return {hit.fraction, object.number, hit.point, hit.normal, hit.triangle};
}
inline Founds sorted(const std::vector<ObjectHit>& hits) {
  Founds out;
  for (const ObjectHit& hit : hits) out.push_back(found(*hit.object, hit.hit));
  std::sort(out.begin(), out.end());
  return out;
}
inline Founds only(const ObjectHit& hit) {
  return hit.object == nullptr ? Founds() : Founds{found(*hit.object, hit.hit)};
}
inline Founds first_of(const Founds& all) { return all.empty() ? Founds() : Founds{all.front()}; }

/// `test(row, hit)` of every object that the filter admits.
template <class Test>
Founds test_all(const std::vector<TestObject>& rows, const QueryFilter& filter, Test test) {
  Founds out;
  for (const TestObject& row : rows) {
    ShapeHit hit;
    if (row.number != 0 && queries::admits(filter, row, [&] { return row.group; }) && test(row, hit))
      out.push_back(found(row, hit));
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// Queries, and what exact tests of all objects say.
struct Batch {
  std::vector<queries::QueryTime> times;  ///< of queries about SweptFrames
  std::vector<AskedRay> rays;
  std::vector<AskedShape> shapes;
  std::vector<AskedPoint> points;
  std::vector<Founds> cast, swept, overlapped, near;
};

/// Adds all kinds of queries along one path.
inline void add(const geometry::ShapeView& view, const std::vector<TestObject>& rows, const Vec3d& start,
                const Vec3d& displacement, ShapeNumber shape, const Quat& orientation, double distance,
                const QueryFilter& filter, Batch& batch) {
  const Ray ray = Ray::along(start, displacement);
  const QueryShape moving{view, shape, orientation};
  batch.rays.push_back({ray, filter});
  batch.shapes.push_back({moving, ray, filter});
  batch.points.push_back({start, distance, filter});
  batch.cast.push_back(test_all(rows, filter, [&](const FrameObject& row, ShapeHit& hit) {
    return narrow_phase::cast_ray(view, row.shape, row.pose, ray, 1, hit);
  }));
  batch.swept.push_back(test_all(rows, filter, [&](const FrameObject& row, ShapeHit& hit) {
    return narrow_phase::sweep_shape(view, row.shape, row.pose, moving, ray, 1, hit);
  }));
  batch.overlapped.push_back(test_all(rows, filter, [&](const FrameObject& row, ShapeHit& hit) {
    return narrow_phase::overlaps(view, row.shape, row.pose, moving, start, hit.triangle);
  }));
  batch.near.push_back(test_all(rows, filter, [&](const FrameObject& row, ShapeHit& hit) {
    narrow_phase::NearestPoint point;
    if (!narrow_phase::find_nearest(view, row.shape, row.pose, start, distance, point)) return false;
    hit.fraction = point.distance;
    hit.point = point.point;
    hit.triangle = point.triangle;
    return true;
  }));
}

inline Founds only(const ObjectPoint& found) {
  if (found.object == nullptr) return {};
  const narrow_phase::NearestPoint& nearest = found.nearest;
  return {{nearest.distance, found.object->number, nearest.point, {}, nearest.triangle}};
}

/// Compares the answers of one searcher to queries `first` to `end - 1` of a batch, asked together.
template <class Part>
void check(Searcher& searcher, const Part& part, const geometry::ShapeView& view, const Batch& batch, std::size_t first,
           std::size_t end) {
  const std::size_t count = end - first;
  const queries::FrameMoment moment{view, std::span(batch.times).subspan(batch.times.empty() ? 0 : first)};
  const std::span rays = std::span(batch.rays).subspan(first, count);
  const std::span moving = std::span(batch.shapes).subspan(first, count);
  const std::span points = std::span(batch.points).subspan(first, count);
  QueryWork work;
  std::vector<ObjectHit> cast(count), swept(count);
  std::vector<ObjectPoint> near(count);
  const auto any = std::make_unique<bool[]>(count);
  Lists cast_all(count), swept_all(count), overlapped(count);
  searcher.cast(part, moment, rays, cast, work);
  searcher.cast_any(part, moment, rays, {any.get(), count}, work);
  searcher.cast_all(part, moment, rays, cast_all, work);
  searcher.sweep(part, moment, moving, swept, work);
  searcher.sweep_all(part, moment, moving, swept_all, work);
  searcher.overlap(part, moment, moving, overlapped, work);
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

/// Adds random queries about objects around `origin`, most of which are within `half` of it.
inline void add_random(const geometry::ShapeView& view, const std::vector<TestObject>& rows, Random& random,
                       double half, const Vec3d& origin, Batch& batch) {
  const double lengths[] = {0, 1, half, 4 * half, 1e6};
  const Vec3d offset = random.in_cube(1.2 * half);
  const TestObject none;
  const auto any_row = [&]() -> const TestObject& { return rows.empty() ? none : rows[random.below(rows.size())]; };
  const Vec3d start = random.below(4) == 0 ? any_row().pose.position
                                           : Vec3d{origin.x + offset.x, origin.y + offset.y, origin.z + offset.z};
  Vec3d displacement = random.in_cube(lengths[random.below(5)]);
  if (random.below(6) == 0) displacement.x = displacement.y = 0;  // along an axis
  QueryFilter filter;
  if (random.below(4) == 0) filter.layers = static_cast<std::uint32_t>(random.below(32));
  if (random.below(4) == 0) filter.categories = static_cast<std::uint32_t>(random.below(16));
  if (random.below(4) == 0) filter.except_group = static_cast<std::uint32_t>(random.below(4));
  const TestObject& except = any_row();
  if (random.below(2) == 0) filter.except = ObjectId::of(except.number, except.generation);
  const double distance = random.below(3) == 0 ? std::numeric_limits<double>::infinity() : random.uniform(0, half);
  const auto shape = static_cast<ShapeNumber>(random.below(mesh_shape));
  add(view, rows, start, displacement, shape, random.orientation(), distance, filter, batch);
}

}  // namespace ringfence::queries_test
