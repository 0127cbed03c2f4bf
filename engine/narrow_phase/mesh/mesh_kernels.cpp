#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/mesh/mesh_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/mesh/mesh_convex-inl.hpp"
#include "narrow_phase/mesh/mesh_hull-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

template <class Query>
PairContact contact_of(const MeshWalk<Query>& walk, const Query& query, const MeshFrame& frame, double slack,
                       std::uint32_t pair, bool mesh_is_a) {
  const Penetration& penetration = walk.deepest().penetration();
  Vec3d corners[Query::max_corners];
  const std::size_t count = query.corners(penetration, corners);
  const Vec3d point = contact_point_of(penetration, walk.triangle(), {corners, count}, query.rounding(), slack);
  return frame.contact(pair, penetration, point, mesh_is_a);
}

/// Tests a convex shape against a mesh, in either order.
template <class Query, bool mesh_first = false>
PairContact* run_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  for (const KernelPair& pair : input.pairs) {
    const Body& convex = input.bodies[mesh_first ? pair.second : pair.first];
    const Body& surface = input.bodies[mesh_first ? pair.first : pair.second];
    const geometry::ShapeRow& row = input.shapes.row(convex.shape);
    const geometry::ShapeRow& mesh_row = input.shapes.row(surface.shape);
    const MeshFrame frame(surface.pose, convex.pose);
    const Query query = Query::of(input.shapes, row, frame);
    const double small = double{std::min(row.bounding_radius, mesh_row.bounding_radius)};
    const double sizes = double{row.bounding_radius} + double{mesh_row.bounding_radius};
    MeshWalk<Query> walk(input.shapes.mesh(mesh_row.index_in_kind).tree(), query, bound_margin * sizes);
    const bool touches = walk.run();
    walk.work().add_to(counters);
    if (!touches) continue;
    *out++ = contact_of(walk, query, frame, feature_slack(small, sizes), pair.pair, (pair.flipped == 0) == mesh_first);
  }
  return out;
}

PairContact* sphere_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run_mesh<BallInMesh>(input, out, counters);
}
PairContact* box_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run_mesh<BoxInMesh>(input, out, counters);
}
PairContact* capsule_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run_mesh<CapsuleInMesh>(input, out, counters);
}
PairContact* hull_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run_mesh<HullInMesh>(input, out, counters);
}
PairContact* mesh_support(const KernelInput& input, PairContact* out, KindCounters& counters) {
  KernelInput one = input;
  for (std::size_t i = 0; i < input.pairs.size(); ++i) {
    one.pairs = input.pairs.subspan(i, 1);
    try {
      out = run_mesh<SupportInMesh, true>(one, out, counters);
    } catch (const geometry::SupportFailure&) {
      ++counters.failed;
    }
  }
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(sphere_mesh);
HWY_EXPORT(box_mesh);
HWY_EXPORT(capsule_mesh);
HWY_EXPORT(hull_mesh);
HWY_EXPORT(mesh_support);

PairContact* test_sphere_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(sphere_mesh)(input, out, counters);
}
PairContact* test_box_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(box_mesh)(input, out, counters);
}
PairContact* test_capsule_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(capsule_mesh)(input, out, counters);
}
PairContact* test_hull_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(hull_mesh)(input, out, counters);
}
PairContact* test_mesh_support(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(mesh_support)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
