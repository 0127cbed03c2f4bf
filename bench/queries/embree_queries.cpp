#include <embree3/rtcore.h>

#include "geometry/bounds.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/query/shape_query.hpp"
#include "queries/query_scene.hpp"

namespace ringfence::bench {
namespace {

using narrow_phase::Ray;

/// Metres by which objects may be outside the scene's bounds: the fixed point of their bounds saturates.
constexpr Vec3d outside{10, 10, 10};

/// A ray for Embree, whose places are fractions of the displacement.
RTCRayHit embree_ray(const Vec3d& start, const Vec3d& displacement) {
  RTCRayHit out{};
  out.ray.org_x = static_cast<float>(start.x);
  out.ray.org_y = static_cast<float>(start.y);
  out.ray.org_z = static_cast<float>(start.z);
  out.ray.dir_x = static_cast<float>(displacement.x);
  out.ray.dir_y = static_cast<float>(displacement.y);
  out.ray.dir_z = static_cast<float>(displacement.z);
  out.ray.tfar = 1;
  out.ray.mask = ~0u;
  out.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  return out;
}

/// User geometry with tight bounds, which are widened for sweeps. The callbacks are our exact tests, because Embree has
/// none for solid shapes.
class Embree final : public QueryTester {
 public:
  Embree(const QueryScene& scene, bool refit)
      : scene_(scene),
        shapes_(scene.shapes->view()),
        space_(scene.scene.bounds_min - outside, scene.scene.bounds_max + outside),
        bounds_(scene.objects()),
        placed_(scene.objects()) {
    device_ = rtcNewDevice("threads=1");
    tree_ = rtcNewScene(device_);
    rtcSetSceneFlags(tree_, RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(tree_, RTC_BUILD_QUALITY_LOW);
    geometry_ = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_USER);
    if (refit) rtcSetGeometryBuildQuality(geometry_, RTC_BUILD_QUALITY_REFIT);
    rtcSetGeometryUserPrimitiveCount(geometry_, static_cast<unsigned>(scene.objects()));
    rtcSetGeometryUserData(geometry_, this);
    rtcSetGeometryBoundsFunction(geometry_, bounds_of, this);
    rtcSetGeometryIntersectFunction(geometry_, intersect);
    rtcSetGeometryPointQueryFunction(geometry_, overlap_one);
    rtcAttachGeometry(tree_, geometry_);
  }
  ~Embree() override {
    rtcReleaseGeometry(geometry_);
    rtcReleaseScene(tree_);
    rtcReleaseDevice(device_);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;

  void update(const std::vector<Pose>& poses) override {
    poses_ = poses.data();
    for (std::size_t i = 0; i < placed_.size(); ++i) placed_[i] = {&poses[i], scene_.shape(i)};
    scene_.shapes->bounds(placed_, space_, bounds_.data());
    widening_ = scene_.sweeps.empty() ? 0 : scene_.ball_radius;
    rtcCommitGeometry(geometry_);
    rtcCommitScene(tree_);
  }
  void cast(std::span<FirstAnswer> out) override {
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i] = ask(Ray::along(scene_.rays[i].start, scene_.rays[i].displacement));
    }
  }
  void sweep(std::span<FirstAnswer> out) override {
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i] = ask(Ray::along(scene_.sweeps[i].start.position, scene_.sweeps[i].displacement));
    }
  }
  std::size_t overlap() override {
    found_ = 0;
    for (const OverlapQuery& query : scene_.overlaps) {
      position_ = query.pose.position;
      RTCPointQuery point{static_cast<float>(position_.x), static_cast<float>(position_.y),
                          static_cast<float>(position_.z), 0, scene_.ball_radius};
      RTCPointQueryContext context;
      rtcInitPointQueryContext(&context);
      rtcPointQuery(tree_, &point, &context, nullptr, this);
    }
    return found_;
  }

 private:
  FirstAnswer ask(const Ray& ray) {
    ray_ = &ray;
    best_ = {};
    RTCRayHit hit = embree_ray(ray.start, ray.displacement);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(tree_, &context, &hit);
    return best_;
  }
  static void bounds_of(const RTCBoundsFunctionArguments* arguments) {
    const auto& self = *static_cast<const Embree*>(arguments->geometryUserPtr);
    const geometry::Bounds& b = self.bounds_[arguments->primID];
    const Vec3d min = self.space_.min(), scale = self.space_.scale();
    const double more = double{self.widening_};
    RTCBounds& out = *arguments->bounds_o;
    out.lower_x = static_cast<float>(min.x + b.lower[0] / scale.x - more);
    out.lower_y = static_cast<float>(min.y + b.lower[1] / scale.y - more);
    out.lower_z = static_cast<float>(min.z + b.lower[2] / scale.z - more);
    out.upper_x = static_cast<float>(min.x + b.upper[0] / scale.x + more);
    out.upper_y = static_cast<float>(min.y + b.upper[1] / scale.y + more);
    out.upper_z = static_cast<float>(min.z + b.upper[2] / scale.z + more);
  }
  static void intersect(const RTCIntersectFunctionNArguments* arguments) {
    if (arguments->valid[0] == 0) return;
    auto& self = *static_cast<Embree*>(arguments->geometryUserPtr);
    auto& ray = *reinterpret_cast<RTCRayHit*>(arguments->rayhit);
    const unsigned object = arguments->primID;
    const Pose& pose = self.poses_[object];
    const double limit = double{ray.ray.tfar};
    narrow_phase::ShapeHit hit;
    const bool found =
        self.scene_.sweeps.empty()
            ? narrow_phase::cast_ray(self.shapes_, self.scene_.shape(object), pose, *self.ray_, limit, hit)
            : narrow_phase::sweep_shape(self.shapes_, self.scene_.shape(object), pose,
                                        {self.shapes_, self.scene_.ball, {}}, *self.ray_, limit, hit);
    if (!found || (self.best_.object != 0 && hit.fraction >= self.best_.place)) return;
    self.best_ = {object + 1, hit.fraction};
    ray.ray.tfar = static_cast<float>(hit.fraction);
    ray.hit.geomID = arguments->geomID;
    ray.hit.primID = object;
  }
  static bool overlap_one(RTCPointQueryFunctionArguments* arguments) {
    auto& self = *static_cast<Embree*>(arguments->userPtr);
    std::uint32_t triangle = 0;
    self.found_ +=
        narrow_phase::overlaps(self.shapes_, self.scene_.shape(arguments->primID), self.poses_[arguments->primID],
                               {self.shapes_, self.scene_.ball, {}}, self.position_, triangle)
            ? 1
            : 0;
    return false;
  }

  const QueryScene& scene_;
  geometry::ShapeView shapes_;
  geometry::FixedSpace space_;
  std::vector<geometry::Bounds> bounds_;
  std::vector<geometry::PlacedShape> placed_;
  const Pose* poses_ = nullptr;
  float widening_ = 0;
  const Ray* ray_ = nullptr;
  FirstAnswer best_;
  Vec3d position_;
  std::size_t found_ = 0;
  RTCDevice device_;
  RTCScene tree_;
  RTCGeometry geometry_;
};

}  // namespace

std::unique_ptr<QueryTester> make_embree_queries(const QueryScene& scene, bool refit) {
  return std::make_unique<Embree>(scene, refit);
}

}  // namespace ringfence::bench
