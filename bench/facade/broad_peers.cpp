#include <algorithm>
#include <utility>

#include "broad_phase/box_worlds.hpp"
#include "facade/own_kernels.hpp"

namespace ringfence::bench {
namespace {

/// Another library's broad phase followed by our kernels, in one loop.
class BroadPeer final : public FrameTester {
 public:
  BroadPeer(const RecordedWorld& world, PairFinder* (*make)(const BoxFrames&)) : crowd_(world), tester_(*world.shapes) {
    boxes_.frames.emplace_back(crowd_.bounds().begin(), crowd_.bounds().end());
    boxes_.present.assign(world.objects(), 1);
    boxes_.resting.assign(world.objects(), 0);
    finder_.reset(make(boxes_));
  }

  void run(const std::vector<Pose>& poses) override {
    crowd_.place(poses, 0, poses.size());
    // Coordinates that are exact in a float, rounded outwards: this adds one candidate in a million.
    constexpr std::uint32_t fraction = 0xff;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      geometry::Bounds box = crowd_.bounds()[i];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box.lower[axis] &= ~fraction;
        box.upper[axis] |= fraction;
      }
      boxes_.frames[0][i] = box;
    }
    finder_->find(boxes_, 0);
    pairs_.clear();
    for (const geometry::CandidatePair pair : finder_->pairs()) {
      pairs_.push_back({std::min(pair.a, pair.b), std::max(pair.a, pair.b)});
    }
    tester_.clear();
    tester_.test(crowd_.bodies(), pairs_);
  }
  std::size_t contacts() const override { return tester_.found().size(); }
  std::vector<std::uint64_t> touching() const override { return tester_.found().keys(); }

 private:
  Crowd crowd_;
  PairTester tester_;
  BoxFrames boxes_;
  std::unique_ptr<PairFinder> finder_;
  std::vector<geometry::CandidatePair> pairs_;
};

}  // namespace

#ifdef RINGFENCE_BENCH_EMBREE
std::unique_ptr<FrameTester> make_embree_frame(const RecordedWorld& world) {
  return std::make_unique<BroadPeer>(world, make_embree);
}
#endif
#ifdef RINGFENCE_BENCH_CGAL
std::unique_ptr<FrameTester> make_cgal_frame(const RecordedWorld& world) {
  return std::make_unique<BroadPeer>(world, make_cgal);
}
#endif

}  // namespace ringfence::bench
