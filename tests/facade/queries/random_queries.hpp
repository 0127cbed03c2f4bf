#pragma once

#include <cstddef>
#include <random>
#include <vector>

#include "ringfence/snapshot.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {

/// Queries of every kind.
struct Queries {
  std::vector<RayQuery> rays;
  std::vector<SweepQuery> sweeps;
  std::vector<OverlapQuery> overlaps;
  std::vector<NearestQuery> nearest;
};

/// The answers to such queries, as one list.
struct Answers {
  std::vector<Hit> hits;
  bool operator==(const Answers&) const = default;
};

/// `count` random queries of each kind about the objects of a world in a cube of `side`, with random filters. Some
/// start at an object, have no displacement, or are very long. Equal seeds and worlds give equal queries. `shapes`:
/// convex.
inline Queries make_queries(const World& world, std::span<const ShapeId> shapes, double side, std::size_t count,
                            unsigned seed) {
  std::mt19937_64 random(seed);
  const std::vector<ObjectView> objects = world.objects();
  const auto uniform = [&](double from, double to) {
    return from + (to - from) * static_cast<double>(random() >> 11) / 9007199254740992.0;
  };
  const auto vector = [&](double size) {
    return Vec3d{uniform(-size, size), uniform(-size, size), uniform(-size, size)};
  };
  const auto any_object = [&] { return objects[random() % objects.size()]; };
  const auto position = [&] {
    if (random() % 4 == 0) return any_object().spec.pose.position;
    const Vec3d v = vector(0.6 * side);
    return Vec3d{v.x + side / 2, v.y + side / 2, v.z + side / 2};
  };
  const auto displacement = [&] {
    const double lengths[] = {0, 1, side / 4, side, 1000 * side};
    return vector(lengths[random() % 5]);
  };
  const auto filter = [&] {
    QueryFilter out;
    if (random() % 4 == 0) out.layers = static_cast<std::uint32_t>(random() % 4);
    if (random() % 4 == 0) out.categories = static_cast<std::uint32_t>(random() % 16);
    if (random() % 4 == 0) out.except_group = static_cast<std::uint32_t>(random() % 4);
    if (random() % 2 == 0) out.except = any_object().id;
    return out;
  };
  const auto pose = [&] {
    const Vec3d axis = vector(1);
    const double size = std::sqrt(axis.x * axis.x + axis.y * axis.y + axis.z * axis.z) + 1e-9;
    return Pose{
        position(),
        {static_cast<float>(axis.x / size), static_cast<float>(axis.y / size), static_cast<float>(axis.z / size), 0}};
  };
  Queries out;
  for (std::size_t i = 0; i < count; ++i) {
    const auto shape = [&] { return shapes[random() % shapes.size()]; };
    out.rays.push_back({position(), displacement(), filter()});
    out.sweeps.push_back({shape(), pose(), displacement(), filter()});
    out.overlaps.push_back({shape(), pose(), filter()});
    out.nearest.push_back(
        {position(), random() % 4 == 0 ? std::numeric_limits<double>::infinity() : uniform(0, side / 4), filter()});
  }
  return out;
}

/// The same queries about another frame.
inline Queries about(Queries queries, QueryFrame frame) {
  for (RayQuery& query : queries.rays) query.frame = frame;
  for (SweepQuery& query : queries.sweeps) query.frame = frame;
  for (OverlapQuery& query : queries.overlaps) query.frame = frame;
  for (NearestQuery& query : queries.nearest) query.frame = frame;
  return queries;
}

/// The same queries, each about one of some frames.
inline Queries about_any(Queries queries, std::span<const double> frames, unsigned seed) {
  std::mt19937_64 random(seed);
  const auto any = [&] { return frames[random() % frames.size()]; };
  for (RayQuery& query : queries.rays) query.frame = any();
  for (SweepQuery& query : queries.sweeps) query.frame = any();
  for (OverlapQuery& query : queries.overlaps) query.frame = any();
  for (NearestQuery& query : queries.nearest) query.frame = any();
  return queries;
}

/// Answers all queries: those with lists as lists in their order, each followed by an empty hit.
inline Answers answer(const Snapshot& snapshot, const Queries& queries, QueryWork* work = nullptr) {
  Answers out;
  const auto add_each = [&](const auto& given, auto batch) {
    std::vector<Hit> hits(given.size());
    batch(hits);
    out.hits.insert(out.hits.end(), hits.begin(), hits.end());
  };
  const auto add_lists = [&](const HitLists& lists) {
    for (std::size_t i = 0; i < lists.size(); ++i) {
      out.hits.insert(out.hits.end(), lists[i].begin(), lists[i].end());
      Hit end;
      end.status = lists.status(i);
      out.hits.push_back(end);
    }
  };
  add_each(queries.rays, [&](std::vector<Hit>& hits) { snapshot.cast(queries.rays, hits, work); });
  add_each(queries.sweeps, [&](std::vector<Hit>& hits) { snapshot.sweep(queries.sweeps, hits, work); });
  add_each(queries.nearest, [&](std::vector<Hit>& hits) { snapshot.nearest(queries.nearest, hits, work); });
  HitLists lists;
  snapshot.cast_all(queries.rays, lists, work);
  add_lists(lists);
  snapshot.sweep_all(queries.sweeps, lists, work);
  add_lists(lists);
  snapshot.overlap(queries.overlaps, lists, work);
  add_lists(lists);
  std::vector<AnyHit> any(queries.rays.size());
  snapshot.cast_any(queries.rays, any, work);
  for (const AnyHit& hit : any) {
    Hit as_hit;
    as_hit.status = hit.status;
    as_hit.triangle = hit.hit ? 1 : 0;
    out.hits.push_back(as_hit);
  }
  return out;
}

}  // namespace ringfence::test
