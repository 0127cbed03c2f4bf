#pragma once

#include "narrow_phase/query/shape_query.hpp"
#include "queries/recorded_frame.hpp"
#include "ringfence/query.hpp"

namespace ringfence::facade {

// What the arguments of a query become for the engine. Each function checks them for the frame that the query asks
// about, and returns what Hit::status says; its result is set only with ok. Any thread may call them.

Status check(const RayQuery& query, const queries::RecordedFrame& frame, narrow_phase::Ray& ray) noexcept;

/// A shape and its path; an overlap has no displacement.
struct MovingShape {
  ShapeNumber shape = 0;
  Quat orientation;
  narrow_phase::Ray path;

  narrow_phase::QueryShape in(const geometry::ShapeView& shapes) const noexcept { return {shapes, shape, orientation}; }
};
Status check(const SweepQuery& query, const queries::RecordedFrame& frame, MovingShape& moving) noexcept;
Status check(const OverlapQuery& query, const queries::RecordedFrame& frame, MovingShape& placed) noexcept;

struct NoArguments {};  ///< the query itself has all that is needed
Status check(const NearestQuery& query, const queries::RecordedFrame& frame, NoArguments& nothing) noexcept;

}  // namespace ringfence::facade
