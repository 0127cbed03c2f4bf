#include <deque>

#include "narrow_phase/peer.hpp"
#include "peers/bullet_shape.hpp"

namespace ringfence::narrow_phase_bench {
namespace {

/// One algorithm object per pair, which Bullet's pair cache would keep too; its manifold is cleared before each test.
class Bullet final : public Peer {
 public:
  explicit Bullet(const Crowd& crowd) : dispatcher_(&configuration_) {
    for (ShapeNumber shape = 0; shape < crowd.shapes->size(); ++shape) {
      shapes_.push_back(bench::bullet_shape(*crowd.shapes, shape));
    }
    for (const narrow_phase::Body& body : crowd.bodies) {
      auto object = std::make_unique<btCollisionObject>();
      object->setCollisionShape(shapes_[body.shape].get());
      object->setWorldTransform(bench::bullet_transform(body.pose));
      objects_.push_back(std::move(object));
    }
    for (const geometry::CandidatePair& candidate : crowd.pairs) {
      Pair& pair = pairs_.emplace_back(objects_[candidate.a].get(), objects_[candidate.b].get());
      pair.algorithm = dispatcher_.findAlgorithm(&pair.a, &pair.b, nullptr, BT_CONTACT_POINT_ALGORITHMS);
    }
  }

  ~Bullet() override {
    for (Pair& pair : pairs_) {
      pair.algorithm->~btCollisionAlgorithm();
      dispatcher_.freeCollisionAlgorithm(pair.algorithm);
    }
  }

  Bullet(const Bullet&) = delete;
  Bullet& operator=(const Bullet&) = delete;

  void test() override {
    std::uint8_t* touches = touches_.data();
    for (const std::uint32_t index : selected_) {
      Pair& pair = pairs_[index];
      manifolds_.resizeNoInitialize(0);
      pair.algorithm->getAllContactManifolds(manifolds_);
      for (int i = 0; i < manifolds_.size(); ++i) manifolds_[i]->clearManifold();
      btManifoldResult result(&pair.a, &pair.b);
      pair.algorithm->processCollision(&pair.a, &pair.b, info_, &result);
      bool touch = false;
      const btPersistentManifold* manifold = result.getPersistentManifold();
      for (int i = 0; manifold != nullptr && i < manifold->getNumContacts(); ++i) {
        touch |= manifold->getContactPoint(i).getDistance() <= 0;
      }
      *touches++ = touch;
    }
  }

 private:
  struct Pair {
    Pair(btCollisionObject* p, btCollisionObject* q)
        : a(nullptr, p->getCollisionShape(), p, p->getWorldTransform(), -1, -1),
          b(nullptr, q->getCollisionShape(), q, q->getWorldTransform(), -1, -1) {}
    btCollisionObjectWrapper a, b;
    btCollisionAlgorithm* algorithm = nullptr;
  };

  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDispatcherInfo info_;
  btManifoldArray manifolds_;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btCollisionObject>> objects_;
  std::deque<Pair> pairs_;
};

}  // namespace

std::unique_ptr<Peer> make_bullet(const Crowd& crowd) { return std::make_unique<Bullet>(crowd); }

}  // namespace ringfence::narrow_phase_bench
