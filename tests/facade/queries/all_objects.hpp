#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "facade/queries/random_queries.hpp"
#include "geometry/shape_table.hpp"
#include "narrow_phase/query/shape_query.hpp"

namespace ringfence::test {

/// Answers queries by an exact test of every object of a world, without an index: the oracle for snapshots.
class AllObjects {
 public:
  explicit AllObjects(const World& world) : AllObjects(world, world.objects()) {}
  /// Other objects with the shapes of the world.
  AllObjects(const World& world, std::vector<ObjectView> objects) : objects_(std::move(objects)) {
    for (std::uint32_t i = 0; i < world.shape_count(); ++i) shapes_.add(world.shape(ShapeId(i)));
  }

  Answers answer(const Queries& queries) const {
    Answers out;
    std::vector<std::vector<Hit>> casts, sweeps;
    for (const RayQuery& query : queries.rays) casts.push_back(cast(query));
    for (const SweepQuery& query : queries.sweeps) sweeps.push_back(sweep(query));
    for (const auto& hits : casts) out.hits.push_back(hits.empty() ? Hit() : hits.front());
    for (const auto& hits : sweeps) out.hits.push_back(hits.empty() ? Hit() : hits.front());
    for (const NearestQuery& query : queries.nearest) out.hits.push_back(nearest(query));
    const auto add = [&](const std::vector<Hit>& hits) {
      out.hits.insert(out.hits.end(), hits.begin(), hits.end());
      out.hits.push_back({});
    };
    for (const auto& hits : casts) add(hits);
    for (const auto& hits : sweeps) add(hits);
    for (const OverlapQuery& query : queries.overlaps) add(overlap(query));
    for (const auto& hits : casts) {
      Hit any;
      any.triangle = hits.empty() ? 0 : 1;
      out.hits.push_back(any);
    }
    return out;
  }

 private:
  static bool admits(const QueryFilter& filter, const ObjectView& object) {
    const ObjectSpec& spec = object.spec;
    return spec.enabled && ((filter.layers >> spec.layer) & 1) == 1 &&
           (filter.categories & bit_of(spec.category)) != 0 &&
           !(filter.except_group != 0 && spec.group == filter.except_group) && object.id != filter.except;
  }

  static Hit hit_of(const ObjectView& object) {
    Hit hit;
    hit.object = object.id;
    hit.user_data = object.spec.user_data;
    return hit;
  }

  /// `test(object, hit)` returns whether the object is hit.
  template <class Test>
  std::vector<Hit> list(const QueryFilter& filter, Test test) const {
    std::vector<Hit> out;
    for (const ObjectView& object : objects_) {
      narrow_phase::ShapeHit found;
      if (!admits(filter, object) || !test(object, found)) continue;
      Hit hit = hit_of(object);
      hit.fraction = found.fraction;
      hit.point = found.point;
      hit.normal = found.normal;
      hit.triangle = found.triangle;
      out.push_back(hit);
    }
    // Objects are in order of number.
    std::stable_sort(out.begin(), out.end(), [](const Hit& p, const Hit& q) { return p.fraction < q.fraction; });
    return out;
  }

  std::vector<Hit> cast(const RayQuery& query) const {
    const narrow_phase::Ray ray = narrow_phase::Ray::along(query.start, query.displacement);
    return list(query.filter, [&](const ObjectView& object, narrow_phase::ShapeHit& hit) {
      return narrow_phase::cast_ray(shapes_.view(), object.spec.shape.number(), object.spec.pose, ray, 1, hit);
    });
  }
  std::vector<Hit> sweep(const SweepQuery& query) const {
    const narrow_phase::Ray path = narrow_phase::Ray::along(query.start.position, query.displacement);
    const narrow_phase::QueryShape moving{shapes_.view(), query.shape.number(), query.start.orientation};
    return list(query.filter, [&](const ObjectView& object, narrow_phase::ShapeHit& hit) {
      return narrow_phase::sweep_shape(shapes_.view(), object.spec.shape.number(), object.spec.pose, moving, path, 1,
                                       hit);
    });
  }
  std::vector<Hit> overlap(const OverlapQuery& query) const {
    const narrow_phase::QueryShape placed{shapes_.view(), query.shape.number(), query.pose.orientation};
    return list(query.filter, [&](const ObjectView& object, narrow_phase::ShapeHit& hit) {
      hit = {};
      return narrow_phase::overlaps(shapes_.view(), object.spec.shape.number(), object.spec.pose, placed,
                                    query.pose.position, hit.triangle);
    });
  }
  Hit nearest(const NearestQuery& query) const {
    Hit best;
    for (const ObjectView& object : objects_) {
      narrow_phase::NearestPoint found;
      if (!admits(query.filter, object) ||
          !narrow_phase::find_nearest(shapes_.view(), object.spec.shape.number(), object.spec.pose, query.point,
                                      query.distance, found)) {
        continue;
      }
      if (best && best.distance <= found.distance) continue;
      best = hit_of(object);
      best.distance = found.distance;
      best.point = found.point;
      best.triangle = found.triangle;
    }
    return best;
  }

  std::vector<ObjectView> objects_;
  geometry::ShapeTable shapes_;
};

}  // namespace ringfence::test
