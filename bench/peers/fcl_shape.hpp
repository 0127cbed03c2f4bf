#pragma once

#include <memory>
#include <vector>

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/sphere.h>

#include "geometry/shape_table.hpp"

namespace ringfence::bench {

/// The FCL geometry of a shape.
inline std::shared_ptr<fcl::CollisionGeometryd> fcl_shape(const geometry::ShapeTable& shapes, ShapeNumber shape) {
  const geometry::ShapeRow& row = shapes.row(shape);
  const double x = double{row.size[0]}, y = double{row.size[1]}, z = double{row.size[2]};
  switch (row.kind) {
    case ShapeKind::sphere:
      return std::make_shared<fcl::Sphered>(x);
    case ShapeKind::box:
      return std::make_shared<fcl::Boxd>(2 * x, 2 * y, 2 * z);
    case ShapeKind::capsule:
      return std::make_shared<fcl::Capsuled>(x, 2 * y);
    case ShapeKind::mesh: {
      const geometry::Mesh& mesh = shapes.mesh(row.index_in_kind);
      std::vector<fcl::Vector3d> vertices;
      std::vector<fcl::Triangle> triangles;
      for (const Vec3f& v : mesh.vertices()) vertices.push_back({double{v.x}, double{v.y}, double{v.z}});
      for (const auto& t : mesh.triangles()) triangles.emplace_back(t[0], t[1], t[2]);
      auto out = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
      out->beginModel(static_cast<int>(triangles.size()), static_cast<int>(vertices.size()));
      out->addSubModel(vertices, triangles);
      out->endModel();
      return out;
    }
    default: {
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
  }
}

/// The FCL transform of a pose.
inline fcl::Transform3d fcl_transform(const Pose& pose) {
  const Quat& q = pose.orientation;
  fcl::Transform3d transform = fcl::Transform3d::Identity();
  transform.linear() =
      fcl::Quaterniond(double{q.w}, double{q.x}, double{q.y}, double{q.z}).normalized().toRotationMatrix();
  transform.translation() = fcl::Vector3d(pose.position.x, pose.position.y, pose.position.z);
  return transform;
}

}  // namespace ringfence::bench
