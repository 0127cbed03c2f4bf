#include <fcl/narrowphase/collision.h>

#include "narrow_phase/peer.hpp"
#include "peers/fcl_shape.hpp"

namespace ringfence::narrow_phase_bench {
namespace {

class Fcl final : public Peer {
 public:
  explicit Fcl(const Crowd& crowd) : crowd_(crowd) {
    for (ShapeNumber shape = 0; shape < crowd.shapes->size(); ++shape) {
      geometries_.push_back(bench::fcl_shape(*crowd.shapes, shape));
    }
    for (const narrow_phase::Body& body : crowd.bodies) {
      transforms_.push_back(bench::fcl_transform(body.pose));
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
