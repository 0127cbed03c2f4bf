#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "geometry/shape_table.hpp"
#include "ringfence/query.hpp"
#include "worlds/scene.hpp"

namespace ringfence::bench {

/// Objects, their poses in some frames, and queries about them. Object i has number i + 1.
struct QueryScene {
  worlds::Scene scene;
  std::unique_ptr<geometry::ShapeTable> shapes;  ///< the scene's shapes under the same numbers, then `ball`
  std::vector<std::vector<Pose>> frames;         ///< one frame: the objects are static
  ShapeNumber ball = 0;                          ///< of sweeps and overlaps
  float ball_radius = 0;
  std::vector<RayQuery> rays;
  std::vector<SweepQuery> sweeps;
  std::vector<OverlapQuery> overlaps;
  std::vector<NearestQuery> nearest;

  std::size_t objects() const noexcept { return scene.objects.size(); }
  ShapeNumber shape(std::size_t object) const noexcept { return scene.objects[object].shape.number(); }
  /// The shapes of the objects, without the ball.
  std::size_t object_shapes() const noexcept { return scene.shapes.size(); }
};

/// 10,000 queries of the kinds whose numbers are not 0, anywhere in the scene's bounds.
enum class Ask { rays, sweeps, overlaps, nearest };

/// Mixed shapes of the paper's world, which all move.
QueryScene make_moving_scene(std::uint32_t objects, Ask ask);
/// 64,000 static objects with a million triangles: nine of ten are boxes, the others meshes of 48 triangles. A million
/// rays.
QueryScene make_static_scene();

/// Random rays of 50 m that start between two corners; the same for the same arguments.
std::vector<RayQuery> make_rays(const Vec3d& min, const Vec3d& max, std::size_t count);

/// What a query finds first: a number, or 0, and where (fraction, or metres for `nearest`).
struct FirstAnswer {
  ObjectNumber object = 0;
  double place = 0;
};

/// An implementation of queries. Functions without a body in a class are not supported.
class QueryTester {
 public:
  virtual ~QueryTester() = default;
  /// Moves the objects. Not timed: what a world does besides queries.
  virtual void move(const std::vector<Pose>&) {}
  /// Prepares queries about the poses. Timed.
  virtual void update(const std::vector<Pose>& poses) = 0;
  // Answer all queries of the scene. Timed. `out` has one for each query.
  virtual void cast(std::span<FirstAnswer>) {}
  virtual void sweep(std::span<FirstAnswer>) {}
  virtual void find_nearest(std::span<FirstAnswer>) {}
  /// Returns the number of objects that all queries find.
  virtual std::size_t overlap() { return 0; }
};

std::unique_ptr<QueryTester> make_ringfence_queries(const QueryScene& scene);
std::unique_ptr<QueryTester> make_bullet_queries(const QueryScene& scene);
std::unique_ptr<QueryTester> make_fcl_queries(const QueryScene& scene);
/// Embree's tree over the bounds of the objects, rebuilt or refitted for each frame, with our exact tests as callbacks.
std::unique_ptr<QueryTester> make_embree_queries(const QueryScene& scene, bool refit);
/// Embree with the triangles of all objects, built once for quality. For static scenes.
std::unique_ptr<QueryTester> make_embree_triangles(const QueryScene& scene);

}  // namespace ringfence::bench
