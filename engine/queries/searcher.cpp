#include "queries/searcher.hpp"

#include <algorithm>
#include <new>

#include "base/prefetch.hpp"
#include "geometry/checked_support.hpp"
#include "geometry/vector.hpp"

namespace ringfence::queries {
namespace {

using narrow_phase::OverlapTests;
using narrow_phase::QueryShape;
using narrow_phase::Ray;

/// Fewer queries are searched one after another.
constexpr std::size_t smallest_batch = 32;
/// Queries that descend the tree together.
constexpr std::size_t block = 4096;
/// Objects are loaded this many tests in advance.
constexpr std::size_t prefetch_distance = 12;

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

Reach reach_of(const BoxTree& tree, const AskedRay& asked) noexcept {
  return tree.reach(asked.ray.start, asked.ray.start, asked.ray.displacement);
}
Reach reach_of(const BoxTree& tree, const AskedShape& asked) noexcept {
  const Extent extent = extent_of(asked.shape);
  return tree.reach(asked.path.start + extent.lower, asked.path.start + extent.upper, asked.path.displacement);
}

/// Tests one object that a filter may leave out. Returns the limit from now on.
template <class Test>
double test_object(const FramePart& part, const FrameMoment& moment, std::uint32_t box, const QueryFilter& filter,
                   double limit, QueryWork& work, const Test& test) {
  const FrameObject& object = part.object(box);
  if (!admits(filter, object)) return limit;
  ++work.tests;
  try {
    return test(object, part.pose(box, moment.fraction), limit);
  } catch (const geometry::SupportFailure&) {
    ++work.failed_supports;
    return limit;
  }
}

bool is_hit(const FrameMoment& moment, const AskedRay& asked, const FrameObject& object, const Pose& pose, double limit,
            narrow_phase::ShapeHit& hit) {
  return narrow_phase::cast_ray(moment.shapes, object.shape, pose, asked.ray, limit, hit);
}
bool is_hit(const FrameMoment& moment, const AskedShape& asked, const FrameObject& object, const Pose& pose,
            double limit, narrow_phase::ShapeHit& hit) {
  return narrow_phase::sweep_shape(moment.shapes, object.shape, pose, asked.shape, asked.path, limit, hit);
}

}  // namespace

/// `test(object, pose, limit)` returns the limit from now on.
template <class Test>
void Searcher::search_one(const FramePart& part, const FrameMoment& moment, const Reach& reach, double limit,
                          const QueryFilter& filter, QueryWork& work, const Test& test, bool by_distance) const {
  struct Context {
    const FramePart& part;
    const FrameMoment& moment;
    const QueryFilter& filter;
    QueryWork& work;
    const Test& test;
  } context{part, moment, filter, work, test};
  const VisitBox visit = [](void* of, std::uint32_t box, double most) {
    const Context& c = *static_cast<const Context*>(of);
    return test_object(c.part, c.moment, box, c.filter, most, c.work, c.test);
  };
  work.boxes += (by_distance ? kernels_.near : kernels_.reach)(part.tree(), reach, limit, visit, &context);
}

/// One after another. `test(query, object, pose, limit)` returns the limit from now on; `first` is the number of the
/// first query.
template <class Asked, class Test>
void Searcher::search_each(const FramePart& part, const FrameMoment& moment, std::span<const Asked> asked,
                           std::size_t first, QueryWork& work, const Test& test) const {
  for (std::size_t i = 0; i < asked.size(); ++i) {
    const auto test_one = [&](const FrameObject& object, const Pose& pose, double limit) {
      return test(first + i, object, pose, limit);
    };
    search_one(part, moment, reach_of(part.tree(), asked[i]), 1, asked[i].filter, work, test_one, false);
  }
}

/// A block. If it reaches too much for the memory, its halves.
template <class Asked, class Test>
void Searcher::search_together(const FramePart& part, const FrameMoment& moment, std::span<const Asked> asked,
                               std::size_t first, bool first_only, QueryWork& work, const Test& test) {
  if (asked.size() < smallest_batch) {
    search_each(part, moment, asked, first, work, test);
    return;
  }
  for (std::size_t i = 0; i < asked.size(); ++i) reached_.reach(i) = reach_of(part.tree(), asked[i]);
  if (!reached_.find(kernels_, part.tree(), asked.size(), work.boxes)) {
    const std::size_t half = asked.size() / 2;
    search_together(part, moment, asked.first(half), first, first_only, work, test);
    search_together(part, moment, asked.subspan(half), first + half, first_only, work, test);
  } else if (first_only) {
    test_nearest_first(part, moment, asked, first, work, test);
  } else {
    test_all(part, moment, asked, first, work, test);
  }
}

/// In rounds: in each, every query that is not answered tests the nearest of the boxes that are left.
template <class Asked, class Test>
void Searcher::test_nearest_first(const FramePart& part, const FrameMoment& moment, std::span<const Asked> asked,
                                  std::size_t first, QueryWork& work, const Test& test) {
  open_.clear();
  for (std::uint32_t i = 0; i < asked.size(); ++i) {
    if (reached_.begin(i) == reached_.end(i)) continue;
    reached_.sort(i);
    open_.push_back({i, reached_.begin(i), 1});
  }
  while (!open_.empty()) {
    std::size_t left = 0;
    const std::size_t last = open_.size() - 1;
    for (std::size_t i = 0; i < open_.size(); ++i) {
      base::prefetch_object(part.object(reached_[open_[std::min(i + prefetch_distance, last)].next].box));
      Open query = open_[i];
      const auto test_one = [&](const FrameObject& object, const Pose& pose, double limit) {
        return test(first + query.number, object, pose, limit);
      };
      query.limit =
          test_object(part, moment, reached_[query.next].box, asked[query.number].filter, query.limit, work, test_one);
      if (++query.next != reached_.end(query.number) &&
          double{reached_[query.next].at} <= query.limit * (1 + 0x1p-19)) {
        open_[left++] = query;
      }
    }
    open_.resize(left);
  }
}

/// In the order of the queries.
template <class Asked, class Test>
void Searcher::test_all(const FramePart& part, const FrameMoment& moment, std::span<const Asked> asked,
                        std::size_t first, QueryWork& work, const Test& test) {
  const std::uint32_t last = reached_.end(asked.size() - 1) - 1;
  for (std::uint32_t i = 0, next = 0; i < asked.size(); ++i) {
    const auto test_one = [&](const FrameObject& object, const Pose& pose, double limit) {
      return test(first + i, object, pose, limit);
    };
    for (; next != reached_.end(i); ++next) {
      base::prefetch_object(part.object(reached_[std::min<std::uint32_t>(next + prefetch_distance, last)].box));
      test_object(part, moment, reached_[next].box, asked[i].filter, 1, work, test_one);
    }
  }
}

/// `first_only`: each query wants its first hit only, so that it tests the nearest boxes first.
template <class Asked, class Test>
void Searcher::search(const FramePart& part, const FrameMoment& moment, std::span<const Asked> asked, bool first_only,
                      QueryWork& work, const Test& test) {
  // What a call that threw has left.
  list_.clear();
  tested_.clear();
  overlap_tests_.clear();
  if (asked.size() < smallest_batch || !reserve(std::min(block, asked.size()))) {
    search_each(part, moment, asked, 0, work, test);
    return;
  }
  for (std::size_t first = 0; first < asked.size(); first += block) {
    search_together(part, moment, asked.subspan(first, std::min(block, asked.size() - first)), first, first_only, work,
                    test);
  }
}

bool Searcher::reserve(std::size_t queries) noexcept try {
  open_.reserve(queries);
  return reached_.reserve(queries);
} catch (const std::bad_alloc&) {
  return false;
}

template <class Asked>
void Searcher::find_first(const FramePart& part, const FrameMoment& moment, std::span<const Asked> asked,
                          std::span<ObjectHit> found, QueryWork& work) {
  search(part, moment, asked, true, work,
         [&](std::size_t query, const FrameObject& object, const Pose& pose, double most) {
           ObjectHit& best = found[query];
           if (best.object != nullptr) most = std::min(most, best.hit.fraction);
           narrow_phase::ShapeHit hit;
           if (is_hit(moment, asked[query], object, pose, most, hit) &&
               comes_first(hit.fraction, object, best.hit.fraction, best.object)) {
             best = {&object, hit};
           }
           return best.object == nullptr ? most : best.hit.fraction;
         });
}

template <class Asked>
void Searcher::find_all(const FramePart& part, const FrameMoment& moment, std::span<const Asked> asked, ListSink& found,
                        QueryWork& work) {
  search(part, moment, asked, false, work,
         [&](std::size_t query, const FrameObject& object, const Pose& pose, double most) {
           narrow_phase::ShapeHit hit;
           if (is_hit(moment, asked[query], object, pose, 1, hit)) {
             list(static_cast<std::uint32_t>(query), {&object, hit}, found);
           }
           return most;
         });
  finish_list(found);
}

void Searcher::cast(const FramePart& part, const FrameMoment& moment, std::span<const AskedRay> asked,
                    std::span<ObjectHit> found, QueryWork& work) noexcept {
  find_first(part, moment, asked, found, work);
}

void Searcher::sweep(const FramePart& part, const FrameMoment& moment, std::span<const AskedShape> asked,
                     std::span<ObjectHit> found, QueryWork& work) noexcept {
  find_first(part, moment, asked, found, work);
}

void Searcher::cast_all(const FramePart& part, const FrameMoment& moment, std::span<const AskedRay> asked,
                        ListSink& found, QueryWork& work) {
  find_all(part, moment, asked, found, work);
}

void Searcher::sweep_all(const FramePart& part, const FrameMoment& moment, std::span<const AskedShape> asked,
                         ListSink& found, QueryWork& work) {
  find_all(part, moment, asked, found, work);
}

void Searcher::cast_any(const FramePart& part, const FrameMoment& moment, std::span<const AskedRay> asked,
                        std::span<bool> found, QueryWork& work) noexcept {
  search(part, moment, asked, true, work,
         [&](std::size_t query, const FrameObject& object, const Pose& pose, double most) {
           narrow_phase::ShapeHit hit;
           found[query] = is_hit(moment, asked[query], object, pose, 1, hit);
           return found[query] ? -1.0 : most;
         });
}

void Searcher::overlap(const FramePart& part, const FrameMoment& moment, std::span<const AskedShape> asked,
                       ListSink& found, QueryWork& work) {
  std::size_t last = asked.size();
  search(part, moment, asked, false, work,
         [&](std::size_t query, const FrameObject& object, const Pose& pose, double most) {
           const QueryShape& shape = asked[query].shape;
           const Vec3d& position = asked[query].path.start;
           const auto number = static_cast<std::uint32_t>(query);
           if (OverlapTests::tests(moment.shapes.row(object.shape).kind) &&
               OverlapTests::tests(moment.shapes.row(shape.shape).kind)) {
             if (query != last) overlap_tests_.set_query({position, shape.orientation}, shape.shape);
             last = query;
             overlap_tests_.add(pose, object.shape);
             tested_.push_back({number, &object});
             if (overlap_tests_.size() == OverlapTests::most) list_overlaps(moment.shapes, found);
             return most;
           }
           list_overlaps(moment.shapes, found);  // first, so that the lists stay in order
           narrow_phase::ShapeHit hit;
           if (narrow_phase::overlaps(moment.shapes, object.shape, pose, shape, position, hit.triangle)) {
             list(number, {&object, hit}, found);
           }
           return most;
         });
  list_overlaps(moment.shapes, found);
  finish_list(found);
}

void Searcher::list_overlaps(const geometry::ShapeView& shapes, ListSink& found) {
  const std::span<const std::uint8_t> results = overlap_tests_.run(shapes);
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (results[i] != 0) list(tested_[i].query, {tested_[i].object, {}}, found);
  }
  tested_.clear();
}

void Searcher::list(std::uint32_t query, const ObjectHit& hit, ListSink& found) {
  if (query != listed_query_) finish_list(found);
  listed_query_ = query;
  list_.push_back(hit);
}

void Searcher::finish_list(ListSink& found) {
  if (!list_.empty()) found.add(listed_query_, list_);
  list_.clear();
}

void Searcher::nearest(const FramePart& part, const FrameMoment& moment, std::span<const AskedPoint> asked,
                       std::span<ObjectPoint> found, QueryWork& work) noexcept {
  for (std::size_t i = 0; i < asked.size(); ++i) {
    ObjectPoint& best = found[i];
    const AskedPoint& wanted = asked[i];
    const auto test = [&](const FrameObject& object, const Pose& pose, double most) {
      narrow_phase::NearestPoint point;
      if (narrow_phase::find_nearest(moment.shapes, object.shape, pose, wanted.point, most, point) &&
          comes_first(point.distance, object, best.nearest.distance, best.object)) {
        best = {&object, point};
      }
      return best.object == nullptr ? most : best.nearest.distance;
    };
    search_one(part, moment, part.tree().reach(wanted.point, wanted.point, {}), wanted.distance, wanted.filter, work,
               test, true);
  }
}

}  // namespace ringfence::queries
