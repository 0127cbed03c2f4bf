#include "ringfence/collide.hpp"

#include "base/floating_point.hpp"
#include "geometry/shape_table.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/query/shape_pair.hpp"
#include "nodes/host/valid_pose.hpp"

namespace ringfence {

struct PreparedShape::Implementation {
  geometry::ShapeTable table;  ///< of this shape only

  static narrow_phase::ShapePair pair(const Implementation& a, const Implementation& b) noexcept {
    return {a.table.view(), 0, b.table.view(), 0};
  }
};

PreparedShape::PreparedShape(const ShapeDescription& description) {
  const base::DefaultFloatingPoint floating_point;
  const auto implementation = std::make_shared<Implementation>();
  implementation->table.add(description);
  implementation_ = implementation;
}

ShapeKind PreparedShape::kind() const noexcept { return implementation_->table.row(0).kind; }

double PreparedShape::bounding_radius() const noexcept { return double{implementation_->table.row(0).bounding_radius}; }

namespace {

Status make_valid(Pose& a, Pose& b) noexcept {
  const Status status = nodes::make_valid(a);
  return status == Status::ok ? nodes::make_valid(b) : status;
}

}  // namespace

CollideResult collide(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b, const Pose& pose_b) noexcept
    try {
  const base::DefaultFloatingPoint floating_point;
  Pose valid_a = pose_a, valid_b = pose_b;
  CollideResult out;
  out.status = make_valid(valid_a, valid_b);
  if (out.status != Status::ok) return out;
  if (const auto found =
          PreparedShape::Implementation::pair(*a.implementation_, *b.implementation_).contact(valid_a, valid_b)) {
    out.contact = {found->normal, found->depth, valid_a.position + to_double(found->point)};
  }
  return out;
} catch (const geometry::SupportFailure&) {
  return {Status::support_failed, std::nullopt};
}

DistanceResult distance(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b, const Pose& pose_b) noexcept
    try {
  const base::DefaultFloatingPoint floating_point;
  Pose valid_a = pose_a, valid_b = pose_b;
  DistanceResult out;
  out.status = make_valid(valid_a, valid_b);
  if (out.status != Status::ok) return out;
  const narrow_phase::PairDistance found =
      PreparedShape::Implementation::pair(*a.implementation_, *b.implementation_).distance(valid_a, valid_b);
  out.distance = found.distance;
  out.normal = found.normal;
  out.point_a = valid_a.position + found.on_a;
  out.point_b = valid_a.position + found.on_b;
  return out;
} catch (const geometry::SupportFailure&) {
  DistanceResult out;
  out.status = Status::support_failed;
  return out;
}

}  // namespace ringfence
