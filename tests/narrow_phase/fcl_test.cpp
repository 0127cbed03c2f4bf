#include <memory>
#include <vector>

#include <doctest/doctest.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>

#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/pair_world.hpp"
#include "reference/separation.hpp"

using namespace ringfence;
using namespace ringfence::narrow_phase_test;

namespace {

std::shared_ptr<fcl::CollisionGeometryd> convert(const geometry::ShapeTable& shapes, ShapeNumber shape) {
  const geometry::ShapeRow& row = shapes.row(shape);
  const double x = double{row.size[0]}, y = double{row.size[1]}, z = double{row.size[2]};
  if (row.kind == ShapeKind::sphere) return std::make_shared<fcl::Sphered>(x);
  if (row.kind == ShapeKind::box) return std::make_shared<fcl::Boxd>(2 * x, 2 * y, 2 * z);
  if (row.kind == ShapeKind::capsule) return std::make_shared<fcl::Capsuled>(x, 2 * y);
  if (row.kind == ShapeKind::mesh) {
    const geometry::Mesh& mesh = shapes.mesh(row.index_in_kind);
    std::vector<fcl::Vector3d> corners;
    std::vector<fcl::Triangle> triangles;
    for (const Vec3f& v : mesh.vertices()) corners.push_back({double{v.x}, double{v.y}, double{v.z}});
    for (const auto& t : mesh.triangles()) triangles.emplace_back(t[0], t[1], t[2]);
    auto out = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
    out->beginModel(static_cast<int>(triangles.size()), static_cast<int>(corners.size()));
    out->addSubModel(corners, triangles);
    out->endModel();
    return out;
  }
  const geometry::Hull& hull = shapes.hull(row.index_in_kind);
  auto vertices = std::make_shared<std::vector<fcl::Vector3d>>();
  for (std::size_t i = 0; i < hull.vertex_count(); ++i) {
    const Vec3f v = hull.vertex(i);
    vertices->push_back({double{v.x}, double{v.y}, double{v.z}});
  }
  auto faces = std::make_shared<std::vector<int>>();
  for (std::size_t i = 0; i < hull.face_count(); ++i) {
    faces->push_back(static_cast<int>(hull.face(i).size()));
    faces->insert(faces->end(), hull.face(i).begin(), hull.face(i).end());
  }
  return std::make_shared<fcl::Convexd>(vertices, static_cast<int>(hull.face_count()), faces);
}

fcl::Transform3d convert(const Pose& pose) {
  const Quat& q = pose.orientation;
  fcl::Transform3d transform = fcl::Transform3d::Identity();
  transform.linear() =
      fcl::Quaterniond(double{q.w}, double{q.x}, double{q.y}, double{q.z}).normalized().toRotationMatrix();
  transform.translation() = fcl::Vector3d(pose.position.x, pose.position.y, pose.position.z);
  return transform;
}

struct Tally {
  std::size_t touching = 0;
  std::size_t different = 0;
};

/// FCL's results for hulls and rounded shapes are iterative and precise to about 10^-4 of the size. So pairs closer to
/// touching than a thousandth of the smaller size are left out; all others have to agree. FCL's depths are not
/// compared, since for most kinds they are not the least; the reference checks depths.
Tally compare(const PairWorld& world) {
  narrow_phase::NarrowPhase narrow_phase(*world.table);
  std::vector<float> depth(world.pairs.size(), -1.0f);
  for (const narrow_phase::PairContact& contact : narrow_phase.test(world.bodies, world.pairs)) {
    depth[contact.pair] = contact.depth;
  }
  Tally tally;
  for (std::size_t i = 0; i < world.pairs.size(); ++i) {
    const narrow_phase::Body &a = world.bodies[world.pairs[i].a], &b = world.bodies[world.pairs[i].b];
    const double size = double{std::min(world.table->row(a.shape).bounding_radius,  //
                                        world.table->row(b.shape).bounding_radius)};
    const auto separation = reference::separation(world.reference[a.shape], a.pose, world.reference[b.shape], b.pose);
    if (std::abs(separation.distance) < 1e-3 * size) {
      continue;
    }
    const auto first = convert(*world.table, a.shape), second = convert(*world.table, b.shape);
    const fcl::CollisionRequestd request;
    fcl::CollisionResultd result;
    fcl::collide(first.get(), convert(a.pose), second.get(), convert(b.pose), request, result);
    const bool touches = depth[i] >= 0;
    tally.touching += touches ? 1 : 0;
    tally.different += touches != result.isCollision() ? 1 : 0;
  }
  return tally;
}

}  // namespace

TEST_CASE("FCL agrees on contact for every pair of kinds, at the origin and a million metres from it") {
  constexpr ShapeKind kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull};
  for (const ShapeKind p : kinds) {
    for (const ShapeKind q : kinds) {
      for (const double far : {0.0, 1e6}) {
        const std::uint64_t seed = 31;
        const PairWorld world = ordinary_pairs(p, q, 1000, seed, {far, -far, far});
        const Tally tally = compare(world);
        INFO(name_of(p), " ", name_of(q), ", seed ", seed, ", ", far, " m from the origin");
        CHECK(tally.touching > 100);
        CHECK(tally.different == 0);
      }
    }
  }
}

TEST_CASE("FCL agrees on contact for two meshes, and for a mesh and a sphere") {
  for (const ShapeKind kind : {ShapeKind::mesh, ShapeKind::sphere}) {
    const std::uint64_t seed = 33;
    INFO(name_of(kind), ", seed ", seed);
    const Tally tally = compare(ordinary_mesh_pairs(kind, 300, seed));
    CHECK(tally.touching > 60);
    CHECK(tally.different == 0);
  }
}
