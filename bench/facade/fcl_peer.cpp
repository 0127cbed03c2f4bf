#include <deque>
#include <utility>

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/narrowphase/collision.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include "facade/recorded_world.hpp"
#include "peers/fcl_shape.hpp"

namespace ringfence::bench {
namespace {

/// FCL's dynamic tree of boxes. It is updated in each frame with what moved, and rebuilt every 20 frames, because it
/// degrades. One contact per pair, with normal, depth and point. With several threads, one thread finds the pairs,
/// because the tree is not made for more, and all test them.
class Fcl final : public FrameTester {
 public:
  Fcl(const RecordedWorld& world, int threads) : threads_(threads), arena_(threads) {
    for (ShapeNumber shape = 0; shape < world.shapes->size(); ++shape) {
      geometries_.push_back(fcl_shape(*world.shapes, shape));
    }
    for (std::size_t i = 0; i < world.objects(); ++i) {
      fcl::CollisionObjectd& object =
          objects_.emplace_back(geometries_[world.scene.objects[i].shape.number()], fcl_transform(world.frames[0][i]));
      object.setUserData(reinterpret_cast<void*>(i + 1));
      registered_.push_back(&object);
    }
  }

  void run(const std::vector<Pose>& poses) override {
    moved_.clear();
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      if (frame_ != 0 && poses[i] == last_[i]) continue;
      objects_[i].setTransform(fcl_transform(poses[i]));
      objects_[i].computeAABB();
      moved_.push_back(&objects_[i]);
    }
    last_ = poses;
    if (frame_++ % 20 == 0) {
      tree_.clear();
      tree_.registerObjects(registered_);
      tree_.setup();
    } else if (moved_.size() == objects_.size()) {
      tree_.update();
    } else {
      tree_.update(moved_);
    }
    for (Tester& tester : testers_) tester.contacts.clear();
    if (threads_ == 1) {
      const auto test = [](fcl::CollisionObjectd* p, fcl::CollisionObjectd* q, void* tester) {
        static_cast<Tester*>(tester)->test(p, q);
        return false;
      };
      tree_.collide(&testers_.local(), test);
    } else {
      test_in_parallel();
    }
  }
  std::size_t contacts() const override {
    std::size_t sum = 0;
    for (const Tester& tester : testers_) sum += tester.contacts.size();
    return sum;
  }
  std::vector<std::uint64_t> touching() const override {
    std::vector<std::uint64_t> all;
    for (const Tester& tester : testers_) {
      const std::vector<std::uint64_t> keys = tester.contacts.keys();
      all.insert(all.end(), keys.begin(), keys.end());
    }
    return all;
  }

 private:
  using Pair = std::pair<fcl::CollisionObjectd*, fcl::CollisionObjectd*>;

  /// Tests pairs on one thread.
  struct Tester {
    void test(const fcl::CollisionObjectd* p, const fcl::CollisionObjectd* q) {
      result.clear();
      if (fcl::collide(p, q, request, result) == 0) return;
      const fcl::Contactd& found = result.getContact(0);
      Contact& contact = contacts.add();
      contact.a = number_of(p);
      contact.b = number_of(q);
      contact.depth = static_cast<float>(found.penetration_depth);
      contact.normal = {static_cast<float>(found.normal[0]), static_cast<float>(found.normal[1]),
                        static_cast<float>(found.normal[2])};
      contact.point = {found.pos[0], found.pos[1], found.pos[2]};
    }
    const fcl::CollisionRequestd request{1, true};
    fcl::CollisionResultd result;
    ContactList contacts;
  };

  static ObjectNumber number_of(const fcl::CollisionObjectd* object) {
    return static_cast<ObjectNumber>(reinterpret_cast<std::uintptr_t>(object->getUserData()));
  }

  void test_in_parallel() {
    constexpr std::size_t pairs_per_task = 64;
    pairs_.clear();
    tree_.collide(&pairs_, [](fcl::CollisionObjectd* p, fcl::CollisionObjectd* q, void* pairs) {
      static_cast<std::vector<Pair>*>(pairs)->emplace_back(p, q);
      return false;
    });
    arena_.execute([&] {
      tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pairs_.size(), pairs_per_task), [&](const auto& range) {
        Tester& tester = testers_.local();
        for (std::size_t i = range.begin(); i < range.end(); ++i) tester.test(pairs_[i].first, pairs_[i].second);
      });
    });
  }

  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> geometries_;
  std::deque<fcl::CollisionObjectd> objects_;
  std::vector<fcl::CollisionObjectd*> registered_, moved_;
  std::vector<Pose> last_;
  fcl::DynamicAABBTreeCollisionManagerd tree_;
  const int threads_;
  tbb::task_arena arena_;
  tbb::enumerable_thread_specific<Tester> testers_;
  std::vector<Pair> pairs_;
  std::size_t frame_ = 0;
};

}  // namespace

std::unique_ptr<FrameTester> make_fcl_frame(const RecordedWorld& world, int threads) {
  return std::make_unique<Fcl>(world, threads);
}

}  // namespace ringfence::bench
