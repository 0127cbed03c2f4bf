#include <array>

#include <embree3/rtcore.h>

#include "geometry/mesh.hpp"
#include "geometry/vector.hpp"
#include "queries/query_scene.hpp"

namespace ringfence::bench {
namespace {

/// All objects of a static scene as triangles in one geometry; rtcIntersect1 for each ray.
class EmbreeTriangles final : public QueryTester {
 public:
  explicit EmbreeTriangles(const QueryScene& scene) : scene_(scene) {
    for (std::size_t i = 0; i < scene.objects(); ++i) add(i);
    device_ = rtcNewDevice("threads=1");
    tree_ = rtcNewScene(device_);
    rtcSetSceneBuildQuality(tree_, RTC_BUILD_QUALITY_HIGH);
    geometry_ = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices_.data(), 0,
                               sizeof(Vec3f), vertices_.size() - 1);
    rtcSetSharedGeometryBuffer(geometry_, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, triangles_.data(), 0,
                               sizeof(triangles_[0]), triangles_.size());
    rtcCommitGeometry(geometry_);
    rtcAttachGeometry(tree_, geometry_);
    rtcCommitScene(tree_);
  }
  ~EmbreeTriangles() override {
    rtcReleaseGeometry(geometry_);
    rtcReleaseScene(tree_);
    rtcReleaseDevice(device_);
  }
  EmbreeTriangles(const EmbreeTriangles&) = delete;
  EmbreeTriangles& operator=(const EmbreeTriangles&) = delete;

  void update(const std::vector<Pose>&) override {}
  void cast(std::span<FirstAnswer> out) override {
    for (std::size_t i = 0; i < out.size(); ++i) {
      const RayQuery& query = scene_.rays[i];
      RTCRayHit hit{};
      hit.ray.org_x = static_cast<float>(query.start.x);
      hit.ray.org_y = static_cast<float>(query.start.y);
      hit.ray.org_z = static_cast<float>(query.start.z);
      hit.ray.dir_x = static_cast<float>(query.displacement.x);
      hit.ray.dir_y = static_cast<float>(query.displacement.y);
      hit.ray.dir_z = static_cast<float>(query.displacement.z);
      hit.ray.tfar = 1;
      hit.ray.mask = ~0u;
      hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      rtcIntersect1(tree_, &context, &hit);
      const bool found = hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
      out[i] = found ? FirstAnswer{numbers_[hit.hit.primID], double{hit.ray.tfar}} : FirstAnswer();
    }
  }

 private:
  using Triangle = std::array<std::uint32_t, 3>;

  void add(std::size_t object) {
    const Pose& pose = scene_.frames[0][object];
    const geometry::RotationD rotation = geometry::rotation_exact(pose.orientation);
    const geometry::ShapeRow& row = scene_.shapes->row(scene_.shape(object));
    if (!vertices_.empty()) vertices_.pop_back();
    const auto first = static_cast<std::uint32_t>(vertices_.size());
    const auto add_corner = [&](const Vec3d& corner) {
      const Vec3d p = pose.position + geometry::rotate(rotation, corner);
      vertices_.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
    };
    const auto add_triangle = [&](const Triangle& t) {
      triangles_.push_back({first + t[0], first + t[1], first + t[2]});
      numbers_.push_back(static_cast<ObjectNumber>(object + 1));
    };
    if (row.kind == ShapeKind::mesh) {
      const geometry::Mesh& mesh = scene_.shapes->mesh(row.index_in_kind);
      for (const Vec3f& v : mesh.vertices()) add_corner({double{v.x}, double{v.y}, double{v.z}});
      for (const auto& t : mesh.triangles()) add_triangle({t[0], t[1], t[2]});
    } else {
      for (unsigned i = 0; i < 8; ++i) {
        add_corner({(i & 1) != 0 ? double{row.size[0]} : -double{row.size[0]},
                    (i & 2) != 0 ? double{row.size[1]} : -double{row.size[1]},
                    (i & 4) != 0 ? double{row.size[2]} : -double{row.size[2]}});
      }
      constexpr Triangle sides[] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
      for (const Triangle& t : sides) add_triangle(t);
    }
    vertices_.push_back({});  // Embree may read behind the last vertex.
  }

  const QueryScene& scene_;
  std::vector<Vec3f> vertices_;
  std::vector<Triangle> triangles_;
  std::vector<ObjectNumber> numbers_;  ///< of the object, by triangle
  RTCDevice device_;
  RTCScene tree_;
  RTCGeometry geometry_;
};

}  // namespace

std::unique_ptr<QueryTester> make_embree_triangles(const QueryScene& scene) {
  return std::make_unique<EmbreeTriangles>(scene);
}

}  // namespace ringfence::bench
