#include "queries/frame_part.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "geometry/checked_support.hpp"
#include "geometry/vector.hpp"
#include "queries/tree_space.hpp"

namespace ringfence::queries {
namespace {

using narrow_phase::QueryShape;
using narrow_phase::Ray;

/// The exact tests allow shapes to be this far apart, relative to their size. Boxes are widened by it, so that the
/// index cannot leave out what a test would find. Support functions return floats, for which the search ends early.
constexpr float tolerance_of(ShapeKind kind) noexcept { return kind == ShapeKind::support ? 0x1p-12f : 0x1p-16f; }

bool comes_first(double place, const FrameObject& object, double best_place, const FrameObject* best) noexcept {
  return best == nullptr || place < best_place || (place == best_place && object.number < best->number);
}

/// The box of a query's shape around its origin.
struct Extent {
  Vec3d lower, upper;
};
Extent extent_of(const QueryShape& shape) noexcept {
  const geometry::ShapeRow& row = shape.shapes.row(shape.shape);
  const double radius = double{row.bounding_radius} * (1 + double{tolerance_of(row.kind)});
  return {{-radius, -radius, -radius}, {radius, radius, radius}};
}

}  // namespace

/// What every search needs of a query.
struct FramePart::Asked {
  const FrameMoment& moment;
  const QueryFilter& filter;
};

FramePart::FramePart() : kernels_(choose_tree_kernels()) {}

void FramePart::build(std::span<const FrameObject> rows, std::span<const Pose> ends,
                      const geometry::ShapeTable& shapes) {
  rows_ = rows;
  ends_.assign(ends.begin(), ends.end());
  objects_.clear();
  for (std::uint32_t i = 0; i < rows.size(); ++i) {
    if (rows[i].number != 0) objects_.push_back(i);
  }
  find_bounds(shapes);
}

void FramePart::find_bounds(const geometry::ShapeTable& shapes) {
  const geometry::FixedSpace space = choose_space(rows_, objects_, shapes.rows().data());
  bounds_.resize(objects_.size());
  margins_.resize(objects_.size());
  constexpr std::size_t batch = 128;
  std::array<geometry::PlacedShape, batch> placed;
  for (std::size_t first = 0; first < objects_.size(); first += batch) {
    const std::size_t count = std::min(batch, objects_.size() - first);
    for (std::size_t i = 0; i < count; ++i) {
      const FrameObject& object = rows_[objects_[first + i]];
      const geometry::ShapeRow& shape = shapes.row(object.shape);
      placed[i] = {&object.pose, object.shape};
      margins_[first + i] = shape.bounding_radius * tolerance_of(shape.kind);
    }
    if (ends_.empty()) shapes.bounds(std::span(placed).first(count), space, bounds_.data() + first);
  }
  // On its way a shape turns, so its box is that of its bounding ball at both ends.
  for (std::size_t i = 0; i < objects_.size() && !ends_.empty(); ++i) {
    const FrameObject& object = rows_[objects_[i]];
    const Vec3d &from = object.pose.position, &to = ends_[objects_[i]].position;
    const double radius = double{shapes.row(object.shape).bounding_radius} * (1 + 0x1p-20);
    const Vec3d ball{radius, radius, radius};
    bounds_[i] = space.bounds(Vec3d{std::min(from.x, to.x), std::min(from.y, to.y), std::min(from.z, to.z)} - ball,
                              Vec3d{std::max(from.x, to.x), std::max(from.y, to.y), std::max(from.z, to.z)} + ball);
  }
  tree_.build(bounds_, margins_, space);
  row_of_.resize(objects_.size());
  for (std::size_t i = 0; i < row_of_.size(); ++i) row_of_[i] = objects_[tree_.at(i)];
}

Pose FramePart::pose_of(std::size_t row, double fraction) const noexcept {
  const Pose& pose = rows_[row].pose;
  return ends_.empty() ? pose : interpolate(pose, ends_[row], fraction);
}

/// `test(object, pose, limit)` returns the limit from now on.
template <class Test>
void FramePart::search(const Asked& asked, const Reach& reach, double limit, QueryWork& work, const Test& test,
                       bool by_distance) const {
  struct Context {
    const FramePart& part;
    const Asked& asked;
    QueryWork& work;
    const Test& test;
  } context{*this, asked, work, test};
  const VisitBox visit = [](void* of, std::uint32_t box, double most) {
    const Context& c = *static_cast<const Context*>(of);
    const std::uint32_t row = c.part.row_of_[box];
    const FrameObject& object = c.part.rows_[row];
    if (!admits(c.asked.filter, object)) return most;
    ++c.work.tests;
    try {
      return c.test(object, c.part.pose_of(row, c.asked.moment.fraction), most);
    } catch (const geometry::SupportFailure&) {
      ++c.work.failed_supports;
      return most;
    }
  };
  work.boxes += (by_distance ? kernels_.near : kernels_.reach)(tree_, reach, limit, visit, &context);
}

void FramePart::cast(const FrameMoment& moment, const Ray& ray, const QueryFilter& filter, ObjectHit& best,
                     QueryWork& work) const {
  const double limit = best.object == nullptr ? 1 : best.hit.fraction;
  search({moment, filter}, tree_.reach(ray.start, ray.start, ray.displacement), limit, work,
         [&](const FrameObject& object, const Pose& pose, double most) {
           narrow_phase::ShapeHit hit;
           if (narrow_phase::cast_ray(moment.shapes, object.shape, pose, ray, most, hit) &&
               comes_first(hit.fraction, object, best.hit.fraction, best.object)) {
             best = {&object, hit};
           }
           return best.object == nullptr ? most : best.hit.fraction;
         });
}

bool FramePart::cast_any(const FrameMoment& moment, const Ray& ray, const QueryFilter& filter, QueryWork& work) const {
  bool found = false;
  search({moment, filter}, tree_.reach(ray.start, ray.start, ray.displacement), 1, work,
         [&](const FrameObject& object, const Pose& pose, double most) {
           narrow_phase::ShapeHit hit;
           found = narrow_phase::cast_ray(moment.shapes, object.shape, pose, ray, 1, hit);
           return found ? -1.0 : most;
         });
  return found;
}

void FramePart::cast_all(const FrameMoment& moment, const Ray& ray, const QueryFilter& filter,
                         std::vector<ObjectHit>& hits, QueryWork& work) const {
  search({moment, filter}, tree_.reach(ray.start, ray.start, ray.displacement), 1, work,
         [&](const FrameObject& object, const Pose& pose, double most) {
           narrow_phase::ShapeHit hit;
           if (narrow_phase::cast_ray(moment.shapes, object.shape, pose, ray, 1, hit)) hits.push_back({&object, hit});
           return most;
         });
}

void FramePart::sweep(const FrameMoment& moment, const QueryShape& moving, const Ray& path, const QueryFilter& filter,
                      ObjectHit& best, QueryWork& work) const {
  const Extent extent = extent_of(moving);
  const double limit = best.object == nullptr ? 1 : best.hit.fraction;
  search({moment, filter}, tree_.reach(path.start + extent.lower, path.start + extent.upper, path.displacement), limit,
         work, [&](const FrameObject& object, const Pose& pose, double most) {
           narrow_phase::ShapeHit hit;
           if (narrow_phase::sweep_shape(moment.shapes, object.shape, pose, moving, path, most, hit) &&
               comes_first(hit.fraction, object, best.hit.fraction, best.object)) {
             best = {&object, hit};
           }
           return best.object == nullptr ? most : best.hit.fraction;
         });
}

void FramePart::sweep_all(const FrameMoment& moment, const QueryShape& moving, const Ray& path,
                          const QueryFilter& filter, std::vector<ObjectHit>& hits, QueryWork& work) const {
  const Extent extent = extent_of(moving);
  search({moment, filter}, tree_.reach(path.start + extent.lower, path.start + extent.upper, path.displacement), 1,
         work, [&](const FrameObject& object, const Pose& pose, double most) {
           narrow_phase::ShapeHit hit;
           if (narrow_phase::sweep_shape(moment.shapes, object.shape, pose, moving, path, 1, hit)) {
             hits.push_back({&object, hit});
           }
           return most;
         });
}

void FramePart::overlap(const FrameMoment& moment, const QueryShape& query, const Vec3d& position,
                        const QueryFilter& filter, std::vector<ObjectHit>& hits, QueryWork& work) const {
  const Extent extent = extent_of(query);
  search({moment, filter}, tree_.reach(position + extent.lower, position + extent.upper, {}), 1, work,
         [&](const FrameObject& object, const Pose& pose, double most) {
           narrow_phase::ShapeHit hit;
           if (narrow_phase::overlaps(moment.shapes, object.shape, pose, query, position, hit.triangle)) {
             hits.push_back({&object, hit});
           }
           return most;
         });
}

void FramePart::nearest(const FrameMoment& moment, const Vec3d& point, double limit, const QueryFilter& filter,
                        ObjectPoint& best, QueryWork& work) const {
  search(
      {moment, filter}, tree_.reach(point, point, {}), limit, work,
      [&](const FrameObject& object, const Pose& pose, double most) {
        narrow_phase::NearestPoint found;
        if (narrow_phase::find_nearest(moment.shapes, object.shape, pose, point, most, found) &&
            comes_first(found.distance, object, best.nearest.distance, best.object)) {
          best = {&object, found};
        }
        return best.object == nullptr ? most : best.nearest.distance;
      },
      true);
}

}  // namespace ringfence::queries
