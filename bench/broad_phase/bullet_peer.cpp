#include <memory>

#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>
#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>

#include "broad_phase/box_worlds.hpp"

namespace ringfence::bench {
namespace {

// Bullet's two dynamic trees with its pair cache; objects are proxies that are moved in each frame.
class Bullet final : public PairFinder {
 public:
  explicit Bullet(const BoxFrames& world) {
    proxies_.resize(world.present.size());
    for (std::size_t i = 0; i < proxies_.size(); ++i) {
      const geometry::Bounds& b = world.frames[0][i];
      proxies_[i] = tree_.createProxy(corner(b.lower), corner(b.upper), 0, nullptr, 1, 1, nullptr);
      proxies_[i]->m_clientObject = reinterpret_cast<void*>(i);
    }
  }
  ~Bullet() override {
    for (btBroadphaseProxy* proxy : proxies_) tree_.destroyProxy(proxy, nullptr);
  }
  const std::vector<geometry::CandidatePair>& pairs() override { return pairs_; }
  std::size_t find(const BoxFrames& world, std::size_t frame) override {
    const auto& boxes = world.frames[frame];
    for (std::size_t i = 0; i < proxies_.size(); ++i)
      if (world.resting[i] == 0) tree_.setAabb(proxies_[i], corner(boxes[i].lower), corner(boxes[i].upper), nullptr);
    tree_.calculateOverlappingPairs(nullptr);
    // Bullet enlarges its boxes, so its cache holds more than the candidate pairs.
    pairs_.clear();
    const auto& cached = tree_.getOverlappingPairCache()->getOverlappingPairArray();
    for (int k = 0; k < cached.size(); ++k) {
      const auto a = static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(cached[k].m_pProxy0->m_clientObject));
      const auto b = static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(cached[k].m_pProxy1->m_clientObject));
      if (geometry::touch(boxes[a], boxes[b])) pairs_.push_back({a, b});
    }
    return pairs_.size();
  }

 private:
  static btVector3 corner(const std::uint32_t (&v)[3]) {
    const auto metres = [](std::uint32_t c) { return static_cast<btScalar>(c >> 8); };
    return {metres(v[0]), metres(v[1]), metres(v[2])};
  }

  btDbvtBroadphase tree_;
  std::vector<btBroadphaseProxy*> proxies_;
  std::vector<geometry::CandidatePair> pairs_;
};

}  // namespace

PairFinder* make_bullet(const BoxFrames& world) { return new Bullet(world); }

}  // namespace ringfence::bench
