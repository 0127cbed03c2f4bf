#include <deque>

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/narrowphase/collision.h>

#include "facade/recorded_world.hpp"
#include "peers/fcl_shape.hpp"

namespace ringfence::bench {
namespace {

/// FCL's dynamic tree of boxes. It is updated in each frame with what moved, and rebuilt every 20 frames, because it
/// degrades. One contact per pair, with normal, depth and point.
class Fcl final : public FrameTester {
 public:
  explicit Fcl(const RecordedWorld& world) {
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
    contacts_.clear();
    tree_.collide(this, [](fcl::CollisionObjectd* p, fcl::CollisionObjectd* q, void* self) {
      static_cast<Fcl*>(self)->test(p, q);
      return false;
    });
  }
  std::size_t contacts() const override { return contacts_.size(); }
  std::vector<std::uint64_t> touching() const override { return contacts_.keys(); }

 private:
  static ObjectNumber number_of(const fcl::CollisionObjectd* object) {
    return static_cast<ObjectNumber>(reinterpret_cast<std::uintptr_t>(object->getUserData()));
  }

  void test(const fcl::CollisionObjectd* p, const fcl::CollisionObjectd* q) {
    result_.clear();
    if (fcl::collide(p, q, request_, result_) == 0) return;
    const fcl::Contactd& found = result_.getContact(0);
    Contact& contact = contacts_.add();
    contact.a = number_of(p);
    contact.b = number_of(q);
    contact.depth = static_cast<float>(found.penetration_depth);
    contact.normal = {static_cast<float>(found.normal[0]), static_cast<float>(found.normal[1]),
                      static_cast<float>(found.normal[2])};
    contact.point = {found.pos[0], found.pos[1], found.pos[2]};
  }

  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> geometries_;
  std::deque<fcl::CollisionObjectd> objects_;
  std::vector<fcl::CollisionObjectd*> registered_, moved_;
  std::vector<Pose> last_;
  fcl::DynamicAABBTreeCollisionManagerd tree_;
  const fcl::CollisionRequestd request_{1, true};
  fcl::CollisionResultd result_;
  ContactList contacts_;
  std::size_t frame_ = 0;
};

}  // namespace

std::unique_ptr<FrameTester> make_fcl_frame(const RecordedWorld& world) { return std::make_unique<Fcl>(world); }

}  // namespace ringfence::bench
