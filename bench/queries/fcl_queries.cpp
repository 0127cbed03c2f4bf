#include <deque>
#include <limits>

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include "peers/fcl_shape.hpp"
#include "queries/query_scene.hpp"

namespace ringfence::bench {
namespace {

/// FCL's dynamic tree. `update` sets the transforms and updates the tree, or rebuilds it every 20 frames, because it
/// degrades. FCL has no rays, and its sweeps take milliseconds.
class Fcl final : public QueryTester {
 public:
  explicit Fcl(const QueryScene& scene) : scene_(scene) {
    for (ShapeNumber shape = 0; shape < scene.object_shapes(); ++shape) {
      geometries_.push_back(fcl_shape(*scene.shapes, shape));
    }
    for (std::size_t i = 0; i < scene.objects(); ++i) {
      fcl::CollisionObjectd& object =
          objects_.emplace_back(geometries_[scene.shape(i)], fcl_transform(scene.frames[0][i]));
      object.setUserData(reinterpret_cast<void*>(i + 1));
      registered_.push_back(&object);
    }
  }

  void update(const std::vector<Pose>& poses) override {
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      objects_[i].setTransform(fcl_transform(poses[i]));
      objects_[i].computeAABB();
    }
    if (frame_++ % 20 == 0) {
      tree_.clear();
      tree_.registerObjects(registered_);
      tree_.setup();
    } else {
      tree_.update();
    }
  }
  std::size_t overlap() override {
    fcl::CollisionObjectd ball(std::make_shared<fcl::Sphered>(double{scene_.ball_radius}));
    found_ = 0;
    for (const OverlapQuery& query : scene_.overlaps) {
      ball.setTranslation(position(query.pose.position));
      ball.computeAABB();
      tree_.collide(&ball, this, [](fcl::CollisionObjectd* p, fcl::CollisionObjectd* q, void* self) {
        auto& fcl = *static_cast<Fcl*>(self);
        fcl.result_.clear();
        fcl.found_ += fcl::collide(p, q, fcl.request_, fcl.result_) != 0 ? 1 : 0;
        return false;
      });
    }
    return found_;
  }
  void find_nearest(std::span<FirstAnswer> out) override {
    // A ball of 1 mm stands for the point.
    fcl::CollisionObjectd point(std::make_shared<fcl::Sphered>(point_radius));
    for (std::size_t i = 0; i < out.size(); ++i) {
      point.setTranslation(position(scene_.nearest[i].point));
      point.computeAABB();
      best_ = {0, scene_.nearest[i].distance};
      tree_.distance(&point, this, nearest);
      out[i] = best_.object == 0 ? FirstAnswer() : best_;
    }
  }

 private:
  static constexpr double point_radius = 0.001;
  static fcl::Vector3d position(const Vec3d& p) { return {p.x, p.y, p.z}; }
  static bool nearest(fcl::CollisionObjectd* p, fcl::CollisionObjectd* q, void* self, double& limit) {
    auto& fcl = *static_cast<Fcl*>(self);
    fcl::DistanceResultd result;
    const double distance = fcl::distance(p, q, fcl::DistanceRequestd(), result) + point_radius;
    if (distance <= fcl.best_.place) {
      const void* const data = p->getUserData() != nullptr ? p->getUserData() : q->getUserData();
      fcl.best_ = {static_cast<ObjectNumber>(reinterpret_cast<std::uintptr_t>(data)),
                   distance > point_radius ? distance : 0};
    }
    limit = fcl.best_.place;
    return limit <= 0;
  }

  const QueryScene& scene_;
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> geometries_;
  std::deque<fcl::CollisionObjectd> objects_;
  std::vector<fcl::CollisionObjectd*> registered_;
  fcl::DynamicAABBTreeCollisionManagerd tree_;
  const fcl::CollisionRequestd request_{1, false};
  fcl::CollisionResultd result_;
  std::size_t found_ = 0, frame_ = 0;
  FirstAnswer best_;
};

}  // namespace

std::unique_ptr<QueryTester> make_fcl_queries(const QueryScene& scene) { return std::make_unique<Fcl>(scene); }

}  // namespace ringfence::bench
