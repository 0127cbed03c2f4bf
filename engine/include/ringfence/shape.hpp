#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "ringfence/pose.hpp"

namespace ringfence {

/// A ball around the origin.
struct Sphere {
  float radius = 0;  ///< metres
};

/// A box around the origin, with its edges along x, y and z.
struct Box {
  Vec3f half_extents;  ///< metres
};

/// All points within `radius` of the segment from -half_height to +half_height on the z axis.
struct Capsule {
  float radius = 0;       ///< metres
  float half_height = 0;  ///< metres, >= 0; does not include the caps
};

/// The convex hull of `points`. At least 4 points are distinct, not all lie in a plane, and the hull has at most 256
/// vertices. The origin may lie outside. Points that are not vertices of the hull are ignored.
struct ConvexHull {
  std::vector<Vec3f> points;  ///< metres
};

/// A triangle surface, not a solid: 1 to 10^6 triangles, of either winding. Triangles of zero area are ignored, and a
/// warning is logged.
struct TriangleMesh {
  std::vector<Vec3f> vertices;         ///< metres
  std::vector<std::uint32_t> indices;  ///< three indices into `vertices` for each triangle
};

/// A convex shape that is defined only by its support function. libccd tests it, which is slower than for the other
/// kinds and allocates memory within the frame.
///
/// support() and centre() must be pure. Several threads may call them at once, in the default floating-point
/// environment. The points that they return must lie in the shape as it was at registration.
///
/// The bounding ball is the smallest ball around the origin that contains the shape's box on its axes. A call fails if
/// it throws, or if it returns a point that is not finite or has a coordinate whose absolute value exceeds twice the
/// radius of that ball. In World::add_shape a failure is an Error. In a frame nothing is thrown: a pair whose test
/// fails has no contact in that frame and is counted in FrameReport::failed_supports, and an object whose bounds cannot
/// be computed has those of the bounding ball. The first failure of each shape is logged as a warning.
class SupportFunction {
 public:
  virtual ~SupportFunction() = default;
  /// The point of the shape that is farthest along `direction`, metres. The direction is on the shape's axes, not zero,
  /// and of any length.
  virtual Vec3f support(Vec3f direction) const = 0;
  /// A point strictly inside the shape, metres.
  virtual Vec3f centre() const { return {}; }
  /// Name and version by which a save refers to the function: WorldConfig::support_functions has the one with the same
  /// name and version when the World is restored. Change the version whenever support() or centre() change. Without a
  /// name a World with this shape cannot be saved. Constant.
  virtual std::string_view name() const noexcept { return {}; }
  virtual std::uint64_t version() const noexcept { return 0; }
};

/// A shape given by `function`, which is not null. The World keeps the function alive.
struct SupportShape {
  std::shared_ptr<const SupportFunction> function;
};

/// Any shape that an object can have. Coordinates are relative to the shape's origin, on its own axes.
///
/// World::add_shape throws Error if a radius, a half extent, or the bounding radius of a hull or mesh is less than
/// 0.0005 m, if a support shape is thinner than 0.001 m, or if a length or coordinate exceeds 10^6 m.
using ShapeDescription = std::variant<Sphere, Box, Capsule, ConvexHull, TriangleMesh, SupportShape>;

/// Shape kinds. The values equal ShapeDescription::index(), and the two kinds of a pair are ordered by them.
enum class ShapeKind : std::uint8_t { sphere, box, capsule, hull, mesh, support };
inline constexpr std::size_t shape_kinds = 6;

/// Name of a kind in options, benchmark names and reports: "sphere", "box", "capsule", "hull", "mesh", "support".
constexpr const char* name_of(ShapeKind kind) noexcept {
  constexpr const char* names[] = {"sphere", "box", "capsule", "hull", "mesh", "support"};
  return names[static_cast<std::size_t>(kind)];
}

}  // namespace ringfence
