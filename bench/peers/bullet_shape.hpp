#pragma once

#include <memory>

#include <btBulletCollisionCommon.h>

#include "geometry/shape_table.hpp"

namespace ringfence::bench {

/// The Bullet shape of a shape, without margin where Bullet adds one.
inline std::unique_ptr<btCollisionShape> bullet_shape(const geometry::ShapeTable& shapes, ShapeNumber shape) {
  const geometry::ShapeRow& row = shapes.row(shape);
  switch (row.kind) {
    case ShapeKind::sphere:
      return std::make_unique<btSphereShape>(row.size[0]);
    case ShapeKind::box:
      return std::make_unique<btBoxShape>(btVector3(row.size[0], row.size[1], row.size[2]));
    case ShapeKind::capsule:
      return std::make_unique<btCapsuleShapeZ>(row.size[0], 2 * row.size[1]);
    default: {
      const geometry::Hull& hull = shapes.hull(row.index_in_kind);
      auto out = std::make_unique<btConvexHullShape>();
      for (std::size_t i = 0; i < hull.vertex_count(); ++i) {
        const Vec3f v = hull.vertex(i);
        out->addPoint(btVector3(v.x, v.y, v.z), false);
      }
      out->recalcLocalAabb();
      out->setMargin(0);
      return out;
    }
  }
}

/// The Bullet transform of a pose.
inline btTransform bullet_transform(const Pose& pose) {
  const Quat& q = pose.orientation;
  const Vec3d& p = pose.position;
  return btTransform(btQuaternion(q.x, q.y, q.z, q.w).normalized(),
                     btVector3(static_cast<btScalar>(p.x), static_cast<btScalar>(p.y), static_cast<btScalar>(p.z)));
}

}  // namespace ringfence::bench
