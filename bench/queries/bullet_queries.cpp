#include <algorithm>

#include "peers/bullet_shape.hpp"
#include "queries/query_scene.hpp"

namespace ringfence::bench {
namespace {

btVector3 vector(const Vec3d& p) {
  return btVector3(static_cast<btScalar>(p.x), static_cast<btScalar>(p.y), static_cast<btScalar>(p.z));
}

/// Bullet's collision world with its dynamic tree, without dynamics. `update` sets the transforms and updates the tree.
class Bullet final : public QueryTester {
 public:
  explicit Bullet(const QueryScene& scene)
      : scene_(scene), dispatcher_(&configuration_), world_(&dispatcher_, &tree_, &configuration_) {
    for (ShapeNumber shape = 0; shape < scene.shapes->size(); ++shape) {
      shapes_.push_back(bullet_shape(*scene.shapes, shape));
    }
    for (std::size_t i = 0; i < scene.objects(); ++i) {
      auto object = std::make_unique<btCollisionObject>();
      object->setCollisionShape(shapes_[scene.shape(i)].get());
      object->setWorldTransform(bullet_transform(scene.frames[0][i]));
      object->setUserIndex(static_cast<int>(i + 1));
      world_.addCollisionObject(object.get());
      objects_.push_back(std::move(object));
    }
    query_.setCollisionShape(shapes_[scene.ball].get());
  }
  ~Bullet() override {
    for (const auto& object : objects_) world_.removeCollisionObject(object.get());
  }
  Bullet(const Bullet&) = delete;
  Bullet& operator=(const Bullet&) = delete;

  void update(const std::vector<Pose>& poses) override {
    for (std::size_t i = 0; i < objects_.size(); ++i) objects_[i]->setWorldTransform(bullet_transform(poses[i]));
    world_.updateAabbs();
  }
  void cast(std::span<FirstAnswer> out) override {
    for (std::size_t i = 0; i < out.size(); ++i) {
      const btVector3 from = vector(scene_.rays[i].start), to = from + vector(scene_.rays[i].displacement);
      btCollisionWorld::ClosestRayResultCallback found(from, to);
      world_.rayTest(from, to, found);
      out[i] = {};
      if (found.hasHit()) {
        out[i] = {static_cast<ObjectNumber>(found.m_collisionObject->getUserIndex()),
                  double{found.m_closestHitFraction}};
      }
    }
  }
  void sweep(std::span<FirstAnswer> out) override {
    const auto& ball = static_cast<const btConvexShape&>(*shapes_[scene_.ball]);
    for (std::size_t i = 0; i < out.size(); ++i) {
      const btVector3 from = vector(scene_.sweeps[i].start.position), to = from + vector(scene_.sweeps[i].displacement);
      btCollisionWorld::ClosestConvexResultCallback found(from, to);
      world_.convexSweepTest(&ball, btTransform(btQuaternion::getIdentity(), from),
                             btTransform(btQuaternion::getIdentity(), to), found);
      out[i] = {};
      if (found.hasHit()) {
        out[i] = {static_cast<ObjectNumber>(found.m_hitCollisionObject->getUserIndex()),
                  double{found.m_closestHitFraction}};
      }
    }
  }
  std::size_t overlap() override {
    struct Touching final : btCollisionWorld::ContactResultCallback {
      explicit Touching(const btCollisionObject& query) : self(query) {}
      btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper* a, int, int,
                               const btCollisionObjectWrapper* b, int, int) override {
        const btCollisionObject* const other =
            a->getCollisionObject() == &self ? b->getCollisionObject() : a->getCollisionObject();
        if (point.getDistance() <= 0) found.push_back(other->getUserIndex());
        return 0;
      }
      const btCollisionObject& self;
      std::vector<int> found;
    };
    std::size_t all = 0;
    for (const OverlapQuery& query : scene_.overlaps) {
      query_.setWorldTransform(btTransform(btQuaternion::getIdentity(), vector(query.pose.position)));
      Touching touching(query_);
      world_.contactTest(&query_, touching);
      // A pair may have several points.
      std::sort(touching.found.begin(), touching.found.end());
      all +=
          static_cast<std::size_t>(std::unique(touching.found.begin(), touching.found.end()) - touching.found.begin());
    }
    return all;
  }

 private:
  const QueryScene& scene_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase tree_;
  btCollisionWorld world_;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btCollisionObject>> objects_;
  btCollisionObject query_;
};

}  // namespace

std::unique_ptr<QueryTester> make_bullet_queries(const QueryScene& scene) { return std::make_unique<Bullet>(scene); }

}  // namespace ringfence::bench
