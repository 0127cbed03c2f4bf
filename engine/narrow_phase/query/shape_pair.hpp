#pragma once

#include <optional>

#include "geometry/shape_view.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/query/core_distance.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

/// The distance of two placed shapes.
struct PairDistance {
  double distance = 0;  ///< metres; 0 where the shapes overlap or touch
  Vec3d normal;         ///< unit, world axes, from a to b; zero where `distance` is 0
  Vec3d on_a, on_b;     ///< the closest points, relative to a's position, world axes; equal where `distance` is 0
};

/// Two prepared shapes, which may be of different tables, and what is computed of them outside of frames.
///
/// Refers to the shapes. Threads: any; no state between calls. Allocates nothing, except libccd for support shapes.
/// Poses are as in Body: finite, with unit quaternions.
class ShapePair {
 public:
  ShapePair(const geometry::ShapeView& shapes_of_a, ShapeNumber a, const geometry::ShapeView& shapes_of_b,
            ShapeNumber b) noexcept;

  /// The contact of the two: the bits that NarrowPhase::test finds if a is the candidate's a. Throws
  /// geometry::SupportFailure if a support function fails.
  std::optional<PairContact> contact(const Pose& pose_a, const Pose& pose_b) const;

  /// Their distance; see core_distance() for its precision. Throws geometry::SupportFailure.
  PairDistance distance(const Pose& pose_a, const Pose& pose_b) const;

 private:
  geometry::ShapeView view() const noexcept { return {rows_, hulls_, meshes_, supports_}; }
  CoreDistance core_distance_in_a(const Placement& b_in_a) const;
  CoreDistance core_distance_in_b(const Placement& a_in_b) const;

  // Of a and b; kind numbers are 0 and 1 as well.
  geometry::ShapeRow rows_[2];
  const geometry::Hull* hulls_[2] = {};
  const geometry::Mesh* meshes_[2] = {};
  const geometry::CheckedSupport* supports_[2] = {};
};

}  // namespace ringfence::narrow_phase
