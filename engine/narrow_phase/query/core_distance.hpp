#pragma once

#include "narrow_phase/query/convex_core.hpp"

namespace ringfence::narrow_phase {

/// The distance of two placed cores, in their common frame, with the radii of the cores taken into account where
/// stated.
struct CoreDistance {
  enum class Kind {
    apart,   ///< the shapes are apart: all fields are valid
    touch,   ///< the shapes, cores with their radii, overlap or touch
    beyond,  ///< the shapes are farther apart than the limit: only `lower` is valid
  };
  Kind kind = Kind::apart;
  double upper = 0;  ///< metres between `on_a` and `on_b`
  double lower = 0;  ///< metres: proven by a plane between the cores; at most `upper`
  double along = 0;  ///< metres between the cores along `normal`, by their farthest points; about `lower`
  Vec3d on_a, on_b;  ///< a point of each core, without the radius: the closest ones, unless the cores overlap
  Vec3d normal;      ///< unit, from a to b, along the shortest connection; zero if the cores overlap
};

/// Computes the distance of two cores.
///
/// For cores that are exact, `upper` and `lower` differ by at most 2^-45 of the reaches plus 2^-49 of the distance; the
/// true distance lies between them, up to about as much of rounding. For a support function the search ends at 2^-21 of
/// the reaches, or where the floats that it returns allow no more progress.
///
/// `limit`, metres, concerns the shapes with their radii: the search ends as soon as they are proven to be farther
/// apart.
///
/// Method: Gilbert, Johnson and Keerthi (1988). Where rounding keeps double from a proof, which happens at small
/// distances, the search continues from there in twice the precision. Threads: any. No allocation. Throws
/// geometry::SupportFailure if a support function fails. For a point and a hull hull_point_distance() comes first.
CoreDistance core_distance(const ConvexCore& a, const ConvexCore& b, double limit);

/// How far apart `upper` and `lower` may be, but for 2^-49 of the distance. `reaches`: those of both cores, added.
inline double distance_tolerance(double reaches, bool is_exact) noexcept {
  return (is_exact ? 0x1p-45 : 0x1p-21) * reaches;
}

}  // namespace ringfence::narrow_phase
