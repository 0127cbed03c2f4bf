#include "nodes/host/query_arguments.hpp"

#include "nodes/host/valid_pose.hpp"

namespace ringfence::nodes {
namespace {

Status check_position(const Vec3d& position) noexcept {
  return is_valid_pose({position, {}}) ? Status::ok : Status::not_finite;
}

Status check_path(const Vec3d& start, const Vec3d& displacement, narrow_phase::Ray& ray) noexcept {
  for (const Vec3d& vector : {start, displacement}) {
    if (const Status status = check_position(vector); status != Status::ok) return status;
  }
  ray = narrow_phase::Ray::along(start, displacement);
  return Status::ok;
}

Status check_moving(const queries::RecordedFrame& frame, ShapeId shape, Pose start, const Vec3d& displacement,
                    const QueryFilter& filter, queries::AskedShape& asked) noexcept {
  if (const Status status = make_valid(start); status != Status::ok) return status;
  narrow_phase::Ray path;
  if (const Status status = check_path(start.position, displacement, path); status != Status::ok) return status;
  if (!frame.has_shape(shape.number())) return Status::unknown_shape;
  if (frame.shapes().row(shape.number()).kind == ShapeKind::mesh) return Status::bad_shape;
  asked = {{frame.shapes(), shape.number(), start.orientation}, path, filter};
  return Status::ok;
}

}  // namespace

Status check(const RayQuery& query, const queries::RecordedFrame&, queries::AskedRay& asked) noexcept {
  asked.filter = query.filter;
  return check_path(query.start, query.displacement, asked.ray);
}

Status check(const SweepQuery& query, const queries::RecordedFrame& frame, queries::AskedShape& asked) noexcept {
  return check_moving(frame, query.shape, query.start, query.displacement, query.filter, asked);
}

Status check(const OverlapQuery& query, const queries::RecordedFrame& frame, queries::AskedShape& asked) noexcept {
  return check_moving(frame, query.shape, query.pose, {}, query.filter, asked);
}

Status check(const NearestQuery& query, const queries::RecordedFrame&, queries::AskedPoint& asked) noexcept {
  if (!(query.distance >= 0)) return Status::bad_number;
  asked = {query.point, query.distance, query.filter};
  return check_position(query.point);
}

}  // namespace ringfence::nodes
