#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "narrow_phase/pair_world.hpp"
#include "narrow_phase/query/shape_query.hpp"
#include "reference/query_check.hpp"

namespace ringfence::narrow_phase_test {

/// The numbers of queries in these tests are multiples of this. query_accuracy.cpp tests many more.
inline constexpr std::size_t query_scale = 1;

/// A query against one body of a world: the path of a ray, or that of the origin of another body's shape.
struct QueryCase {
  std::uint32_t target, moving;  ///< indices of bodies
  Vec3d start, displacement;
};

/// Queries and their bodies. Where only rays are asked for, `moving` is a ball that does not matter.
struct QueryWorld {
  PairWorld pairs;
  std::vector<QueryCase> cases;

  const narrow_phase::Body& target(const QueryCase& query) const { return pairs.bodies[query.target]; }
  const narrow_phase::Body& moving(const QueryCase& query) const { return pairs.bodies[query.moving]; }
  const reference::PreparedShape& reference_of(const narrow_phase::Body& body) const {
    return pairs.reference[body.shape];
  }
};

/// `count` queries of shapes of kind `moving` (no mesh) against shapes of kind `target`, near the shapes; about half of
/// them hit. `hard`: shapes and paths that are hard: degenerate shapes, grazing paths, along faces and edges, through
/// corners, of no length, of very small or large length, from inside, from the surface. Targets are within 100 m of
/// `origin`. Equal arguments give equal queries, in one build.
QueryWorld make_queries(ShapeKind target, ShapeKind moving, bool hard, std::size_t count, std::uint64_t seed,
                        const Vec3d& origin = {});

/// The results of the queries of a world compared with the reference.
struct QueryTally {
  std::size_t hits = 0, inside = 0, misses = 0, wrong = 0;
  std::string text;  ///< describes the first errors
};

/// Errors of up to `relative` of the smaller size are allowed, besides the rounding of coordinates.
QueryTally check_rays(const QueryWorld& world, double relative);
QueryTally check_sweeps(const QueryWorld& world, double relative);
/// Of the moving shapes at the start of their paths.
QueryTally check_overlaps(const QueryWorld& world, double relative);
/// Of the start of each path; the length of the path is the limit.
QueryTally check_nearest(const QueryWorld& world, double relative);

}  // namespace ringfence::narrow_phase_test
