#include "narrow_phase/query/shape_pair.hpp"

#include <algorithm>
#include <limits>

#include "narrow_phase/kernel.hpp"
#include "narrow_phase/query/mesh_distance.hpp"
#include "narrow_phase/shape_tag.hpp"

namespace ringfence::narrow_phase {
namespace {

constexpr double no_limit = std::numeric_limits<double>::infinity();

/// The placement of one body in the axes of another. The difference of the positions comes first, so that it is precise
/// far from the origin.
Placement relative(const Pose& frame, const Pose& pose) noexcept {
  const geometry::RotationD own = geometry::rotation_exact(frame.orientation);
  const geometry::RotationD other = geometry::rotation_exact(pose.orientation);
  Placement out;
  out.position = geometry::rotate_inverse(own, pose.position - frame.position);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out.rotation.m[i][j] = (own.m[0][i] * other.m[0][j] + own.m[1][i] * other.m[1][j]) + own.m[2][i] * other.m[2][j];
    }
  }
  return out;
}

/// Exchanges the roles of a and b.
void swap_roles(CoreDistance& found) noexcept {
  std::swap(found.on_a, found.on_b);
  found.normal = -found.normal;
}

double radius_of(const geometry::ShapeRow& row) noexcept {
  return row.kind == ShapeKind::sphere || row.kind == ShapeKind::capsule ? double{row.size[0]} : 0.0;
}

}  // namespace

ShapePair::ShapePair(const geometry::ShapeView& shapes_of_a, ShapeNumber a, const geometry::ShapeView& shapes_of_b,
                     ShapeNumber b) noexcept
    : rows_{shapes_of_a.row(a), shapes_of_b.row(b)} {
  const geometry::ShapeView* const views[2] = {&shapes_of_a, &shapes_of_b};
  for (std::uint32_t i = 0; i < 2; ++i) {
    const std::uint32_t index = rows_[i].index_in_kind;
    if (rows_[i].kind == ShapeKind::hull) hulls_[i] = &views[i]->hull(index);
    if (rows_[i].kind == ShapeKind::mesh) meshes_[i] = &views[i]->mesh(index);
    if (rows_[i].kind == ShapeKind::support) supports_[i] = &views[i]->support(index);
    rows_[i].index_in_kind = i;
  }
}

std::optional<PairContact> ShapePair::contact(const Pose& pose_a, const Pose& pose_b) const {
  const Body bodies[2] = {{pose_a, 0, 1}, {pose_b, 1, 2}};
  const bool flipped = rows_[0].kind > rows_[1].kind;
  const KernelPair pair{flipped ? 1u : 0u, flipped ? 0u : 1u, 0, flipped ? flip_bit : 0u};
  KernelInput input{bodies, view(), {&pair, 1}, ShapeTag::needs_double(tag_of(rows_[0]), tag_of(rows_[1]))};
  PairContact out[1 + contact_slack];
  KindCounters counters;
  const PairContact* const end = kernel_of(rows_[pair.first].kind, rows_[pair.second].kind)(input, out, counters);
  if (counters.failed != 0) throw geometry::SupportFailure();
  if (end == out) return std::nullopt;
  return out[0];
}

CoreDistance ShapePair::core_distance_in_a(const Placement& b_in_a) const {
  if (rows_[0].kind == ShapeKind::mesh && rows_[1].kind == ShapeKind::mesh) {
    return mesh_distance(*meshes_[0], *meshes_[1], b_in_a);
  }
  const ConvexCore b(view(), 1, b_in_a);
  if (rows_[0].kind == ShapeKind::mesh) return mesh_distance(*meshes_[0], b);
  return core_distance(ConvexCore(view(), 0, {}), b, no_limit);
}

CoreDistance ShapePair::core_distance_in_b(const Placement& a_in_b) const {
  CoreDistance out = mesh_distance(*meshes_[1], ConvexCore(view(), 0, a_in_b));
  swap_roles(out);
  return out;
}

PairDistance ShapePair::distance(const Pose& pose_a, const Pose& pose_b) const {
  // A mesh is searched in its own axes.
  const bool in_b = rows_[1].kind == ShapeKind::mesh && rows_[0].kind != ShapeKind::mesh;
  const CoreDistance found =
      in_b ? core_distance_in_b(relative(pose_b, pose_a)) : core_distance_in_a(relative(pose_a, pose_b));
  const geometry::RotationD turn = geometry::rotation_exact((in_b ? pose_b : pose_a).orientation);
  const Vec3d origin = in_b ? pose_b.position - pose_a.position : Vec3d{};
  const double radius_a = radius_of(rows_[0]), radius_b = radius_of(rows_[1]);

  PairDistance out;
  const bool apart = found.kind == CoreDistance::Kind::apart && found.upper > radius_a + radius_b;
  // Where the shapes touch, the points meet in the middle of what both contain of the connection of the cores.
  const double to_a = apart ? radius_a : std::clamp(0.5 * (found.upper + radius_a - radius_b), 0.0, found.upper);
  const double to_b = apart ? radius_b : found.upper - to_a;
  out.on_a = origin + geometry::rotate(turn, found.on_a + found.normal * to_a);
  out.on_b = apart ? origin + geometry::rotate(turn, found.on_b - found.normal * to_b) : out.on_a;
  if (apart) {
    out.distance = found.upper - radius_a - radius_b;
    out.normal = geometry::rotate(turn, found.normal);
  }
  return out;
}

}  // namespace ringfence::narrow_phase
