#include "facade/recorded_world.hpp"
#include "peers/bullet_shape.hpp"

namespace ringfence::bench {
namespace {

/// Bullet's collision world without dynamics: two dynamic trees, the pair cache, persistent manifolds.
class Bullet final : public FrameTester {
 public:
  explicit Bullet(const RecordedWorld& world)
      : dispatcher_(&configuration_), world_(&dispatcher_, &tree_, &configuration_) {
    for (ShapeNumber shape = 0; shape < world.shapes->size(); ++shape) {
      shapes_.push_back(bullet_shape(*world.shapes, shape));
    }
    for (std::size_t i = 0; i < world.objects(); ++i) {
      auto object = std::make_unique<btCollisionObject>();
      object->setCollisionShape(shapes_[world.scene.objects[i].shape.number()].get());
      object->setWorldTransform(bullet_transform(world.frames[0][i]));
      object->setUserIndex(static_cast<int>(i + 1));
      world_.addCollisionObject(object.get());
      objects_.push_back(std::move(object));
    }
  }
  ~Bullet() override {
    for (const auto& object : objects_) world_.removeCollisionObject(object.get());
  }
  Bullet(const Bullet&) = delete;
  Bullet& operator=(const Bullet&) = delete;

  void run(const std::vector<Pose>& poses) override {
    for (std::size_t i = 0; i < objects_.size(); ++i) objects_[i]->setWorldTransform(bullet_transform(poses[i]));
    world_.performDiscreteCollisionDetection();
    contacts_.clear();
    for (int m = 0; m < dispatcher_.getNumManifolds(); ++m) take_deepest(*dispatcher_.getManifoldByIndexInternal(m));
  }
  std::size_t contacts() const override { return contacts_.size(); }
  std::vector<std::uint64_t> touching() const override { return contacts_.keys(); }

 private:
  void take_deepest(const btPersistentManifold& manifold) {
    const btManifoldPoint* deepest = nullptr;
    for (int i = 0; i < manifold.getNumContacts(); ++i) {
      const btManifoldPoint& point = manifold.getContactPoint(i);
      if (point.getDistance() <= 0 && (deepest == nullptr || point.getDistance() < deepest->getDistance())) {
        deepest = &point;
      }
    }
    if (deepest == nullptr) return;
    Contact& contact = contacts_.add();
    contact.a = static_cast<ObjectNumber>(manifold.getBody0()->getUserIndex());
    contact.b = static_cast<ObjectNumber>(manifold.getBody1()->getUserIndex());
    contact.depth = -deepest->getDistance();
    const btVector3& n = deepest->m_normalWorldOnB;
    contact.normal = {-n.x(), -n.y(), -n.z()};
    const btVector3 point = (deepest->getPositionWorldOnA() + deepest->getPositionWorldOnB()) * btScalar(0.5);
    contact.point = {double{point.x()}, double{point.y()}, double{point.z()}};
  }

  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase tree_;
  btCollisionWorld world_;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btCollisionObject>> objects_;
  ContactList contacts_;
};

}  // namespace

std::unique_ptr<FrameTester> make_bullet_frame(const RecordedWorld& world) { return std::make_unique<Bullet>(world); }

}  // namespace ringfence::bench
