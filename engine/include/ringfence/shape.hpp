#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "ringfence/pose.hpp"

namespace ringfence {

/// A ball about the origin. `radius` > 0, metres.
struct Sphere {
  float radius = 0;
};

/// A box about the origin, axes along x, y, z. Each half extent > 0, metres.
struct Box {
  Vec3f half_extents;
};

/// All points within `radius` of the segment from -half_height to +half_height on the z axis. Metres;
/// radius > 0, half_height >= 0 (excludes the caps).
struct Capsule {
  float radius = 0;
  float half_height = 0;
};

/// The convex hull of `points`: at least 4 distinct ones, not all in a plane; at most 256 hull vertices.
/// The coordinate origin may lie outside. Points inside the hull are dropped.
struct ConvexHull {
  std::vector<Vec3f> points;
};

/// A triangle surface (not a solid): up to 10^6 triangles, indices into `vertices`, either winding.
struct TriangleMesh {
  std::vector<Vec3f> vertices;
  std::vector<std::uint32_t> indices;  ///< three per triangle
};

/// A convex shape that is defined only by its support function. Tested by libccd: slower than the other kinds, and it
/// allocates inside the frame.
///
/// The function must be pure; it is called concurrently from any thread, in the default floating-point environment. The
/// points that it returns must lie in the shape as it was at registration.
///
/// A call fails if it throws, or if it returns a point that is not finite or that is farther from the origin, on any
/// axis, than twice the radius of the ball around the origin that contains the shape's box. In World::add_shape a
/// failure is an Error. In a frame nothing is thrown: the tested pair has no contact in that frame and is counted in
/// FrameReport::failed_supports; bounds that were to be computed become those of that ball. The first failure of each
/// shape is logged as a warning.
class SupportFunction {
 public:
  virtual ~SupportFunction() = default;
  /// The point of the shape farthest along `direction` (in the shape's axes, not zero, any length).
  virtual Vec3f support(Vec3f direction) const = 0;
  /// A point strictly inside.
  virtual Vec3f centre() const { return {}; }
};

struct SupportShape {
  std::shared_ptr<const SupportFunction> function;
};

/// Any shape that an object can have. Sizes lie between 10^-3 and 10^6 metres.
using ShapeDescription = std::variant<Sphere, Box, Capsule, ConvexHull, TriangleMesh, SupportShape>;

/// Shape kinds in the order of kernels and tables; the values equal ShapeDescription::index().
enum class ShapeKind : std::uint8_t { sphere, box, capsule, hull, mesh, support };
inline constexpr std::size_t shape_kinds = 6;

/// Name of a kind in options, benchmark names and reports: "sphere", "box", "capsule", "hull", "mesh", "support".
constexpr const char* name_of(ShapeKind kind) noexcept {
  constexpr const char* names[] = {"sphere", "box", "capsule", "hull", "mesh", "support"};
  return names[static_cast<std::size_t>(kind)];
}

}  // namespace ringfence
