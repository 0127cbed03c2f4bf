#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>

#include "narrow_phase/peer.hpp"

namespace ringfence::narrow_phase_bench {
namespace {

std::shared_ptr<fcl::CollisionGeometryd> convert(const geometry::ShapeTable& shapes, ShapeNumber shape) {
  const geometry::ShapeRow& row = shapes.row(shape);
  const double x = double{row.size[0]}, y = double{row.size[1]}, z = double{row.size[2]};
  switch (row.kind) {
    case ShapeKind::sphere:
      return std::make_shared<fcl::Sphered>(x);
    case ShapeKind::box:
      return std::make_shared<fcl::Boxd>(2 * x, 2 * y, 2 * z);
    case ShapeKind::capsule:
      return std::make_shared<fcl::Capsuled>(x, 2 * y);
    default: {
      const geometry::Hull& hull = shapes.hull(row.detail);
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

class Fcl final : public Peer {
 public:
  explicit Fcl(const Crowd& crowd) : crowd_(crowd) {
    for (ShapeNumber shape = 0; shape < crowd.shapes->size(); ++shape) {
      geometries_.push_back(convert(*crowd.shapes, shape));
    }
    for (const narrow_phase::Body& body : crowd.bodies) {
      const Quat& q = body.pose.orientation;
      const Vec3d& p = body.pose.position;
      fcl::Transform3d transform = fcl::Transform3d::Identity();
      transform.linear() =
          fcl::Quaterniond(double{q.w}, double{q.x}, double{q.y}, double{q.z}).normalized().toRotationMatrix();
      transform.translation() = fcl::Vector3d(p.x, p.y, p.z);
      transforms_.push_back(transform);
    }
  }

  void test() override {
    std::uint8_t* touches = touches_.data();
    const fcl::CollisionRequestd request(1, true);
    fcl::CollisionResultd result;
    for (const std::uint32_t pair : selected_) {
      const geometry::CandidatePair candidate = crowd_.pairs[pair];
      const narrow_phase::Body &a = crowd_.bodies[candidate.a], &b = crowd_.bodies[candidate.b];
      result.clear();
      fcl::collide(geometries_[a.shape].get(), transforms_[candidate.a], geometries_[b.shape].get(),
                   transforms_[candidate.b], request, result);
      *touches++ = result.isCollision();
    }
  }

 private:
  const Crowd& crowd_;
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> geometries_;
  std::vector<fcl::Transform3d, Eigen::aligned_allocator<fcl::Transform3d>> transforms_;
};

}  // namespace

std::unique_ptr<Peer> make_fcl(const Crowd& crowd) { return std::make_unique<Fcl>(crowd); }

}  // namespace ringfence::narrow_phase_bench
