#include <memory>

#include <embree3/rtcore.h>

#include "broad_phase/box_worlds.hpp"

namespace ringfence::bench {
namespace {

// Embree's collision of a scene of user primitives with itself; the tree is rebuilt in each frame, in one thread.
class Embree final : public PairFinder {
 public:
  explicit Embree(const BoxFrames& world) {
    device_ = rtcNewDevice("threads=1");
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);
    geometry_ = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry_, static_cast<unsigned>(world.present.size()));
    rtcSetGeometryUserData(geometry_, this);
    rtcSetGeometryBoundsFunction(geometry_, bounds_of, this);
    rtcSetGeometryIntersectFunction(geometry_, [](const RTCIntersectFunctionNArguments*) {});
    rtcSetGeometryOccludedFunction(geometry_, [](const RTCOccludedFunctionNArguments*) {});
    rtcAttachGeometry(scene_, geometry_);
  }
  ~Embree() override {
    rtcReleaseGeometry(geometry_);
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  const std::vector<geometry::CandidatePair>& pairs() override { return pairs_; }
  std::size_t find(const BoxFrames& world, std::size_t frame) override {
    boxes_ = world.frames[frame].data();
    pairs_.clear();
    rtcCommitGeometry(geometry_);
    rtcCommitScene(scene_);
    rtcCollide(scene_, scene_, collide, this);
    return pairs_.size();
  }

 private:
  static void bounds_of(const RTCBoundsFunctionArguments* arguments) {
    const auto& self = *static_cast<const Embree*>(arguments->geometryUserPtr);
    const geometry::Bounds& b = self.boxes_[arguments->primID];
    const auto metres = [](std::uint32_t v) { return static_cast<float>(v >> 8); };
    RTCBounds& out = *arguments->bounds_o;
    out.lower_x = metres(b.lower[0]), out.lower_y = metres(b.lower[1]), out.lower_z = metres(b.lower[2]);
    out.upper_x = metres(b.upper[0]), out.upper_y = metres(b.upper[1]), out.upper_z = metres(b.upper[2]);
  }
  // Embree reports some pairs in both orders, and primitives of one leaf without testing them.
  static void collide(void* self, RTCCollision* found, unsigned count) {
    auto& embree = *static_cast<Embree*>(self);
    for (unsigned k = 0; k < count; ++k) {
      const std::uint32_t a = found[k].primID0, b = found[k].primID1;
      if (a < b && geometry::touch(embree.boxes_[a], embree.boxes_[b])) embree.pairs_.push_back({a, b});
    }
  }

  RTCDevice device_;
  RTCScene scene_;
  RTCGeometry geometry_;
  const geometry::Bounds* boxes_ = nullptr;
  std::vector<geometry::CandidatePair> pairs_;
};

}  // namespace

PairFinder* make_embree(const BoxFrames& world) { return new Embree(world); }

}  // namespace ringfence::bench
