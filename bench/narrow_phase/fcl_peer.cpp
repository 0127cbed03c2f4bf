#include <fcl/narrowphase/collision.h>

#include "narrow_phase/peer.hpp"
#include "peers/fcl_shape.hpp"

namespace ringfence::narrow_phase_bench {
namespace {

class Fcl final : public Peer {
 public:
  Fcl(const Crowd& crowd, const fcl::CollisionRequestd& request) : crowd_(crowd), request_(request) {
    for (ShapeNumber shape = 0; shape < crowd.shapes->size(); ++shape) {
      geometries_.push_back(bench::fcl_shape(*crowd.shapes, shape));
    }
    for (const narrow_phase::Body& body : crowd.bodies) {
      transforms_.push_back(bench::fcl_transform(body.pose));
    }
  }

  void test() override {
    std::uint8_t* touches = touches_.data();
    fcl::CollisionResultd result;
    for (const std::uint32_t pair : selected_) {
      const geometry::CandidatePair candidate = crowd_.pairs[pair];
      const narrow_phase::Body &a = crowd_.bodies[candidate.a], &b = crowd_.bodies[candidate.b];
      result.clear();
      fcl::collide(geometries_[a.shape].get(), transforms_[candidate.a], geometries_[b.shape].get(),
                   transforms_[candidate.b], request_, result);
      *touches++ = result.isCollision();
    }
  }

 private:
  const Crowd& crowd_;
  fcl::CollisionRequestd request_;
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> geometries_;
  std::vector<fcl::Transform3d, Eigen::aligned_allocator<fcl::Transform3d>> transforms_;
};

}  // namespace

std::unique_ptr<Peer> make_fcl(const Crowd& crowd) {
  const bool meshes = crowd.a.kind == ShapeKind::mesh || crowd.b.kind == ShapeKind::mesh;
  return std::make_unique<Fcl>(crowd, fcl::CollisionRequestd(meshes ? 1'000'000 : 1, true));
}

std::unique_ptr<Peer> make_fcl_first(const Crowd& crowd) {
  return std::make_unique<Fcl>(crowd, fcl::CollisionRequestd(1, false));
}

}  // namespace ringfence::narrow_phase_bench
