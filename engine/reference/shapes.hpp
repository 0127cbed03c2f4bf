#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "reference/core.hpp"
#include "reference/vector.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::reference {

/// An axis-aligned box in metres; closed.
struct Extents {
  Vector lower, upper;
};

/// Grows a box to hold a point.
void include(Extents& extents, const Vector& point);

/// The smallest box around a placed box.
Extents turned(const Extents& extents, const Placement& placement);

/// A triangle surface: its triangles in double, sorted into compact runs, each with a box around it.
struct Surface {
  struct Triangle {
    Vector corners[3];
  };
  static constexpr std::size_t run_length = 16;

  std::vector<Triangle> triangles;  ///< none without area; the last run may be short
  std::vector<Extents> runs;        ///< around triangles [i * run_length, (i + 1) * run_length)
  Extents extents;                  ///< around all
};

/// A shape prepared for the reference: a convex core, or the triangles of a mesh.
struct PreparedShape {
  ShapeKind kind = ShapeKind::sphere;
  double bounding_radius = 0;  ///< of the least ball about the shape's origin that holds the shape, metres
  Core core;                   ///< all kinds but mesh
  Surface surface;             ///< mesh only
};

/// The shapes of a world as the reference needs them, numbered as they were given.
///
/// Threads: read-only once built; `add` before others read. Memory: everything in double; hulls with their Gauss map.
class Shapes {
 public:
  Shapes() = default;
  explicit Shapes(std::span<const ShapeDescription> shapes);

  /// Throws std::invalid_argument for a flat hull or a mesh without a triangle that has an area. Sizes are taken as
  /// they are: whoever registers shapes checks them.
  ShapeNumber add(const ShapeDescription& shape);

  std::size_t size() const noexcept { return shapes_.size(); }
  const PreparedShape& operator[](ShapeNumber shape) const noexcept { return shapes_[shape]; }

 private:
  std::deque<PreparedShape> shapes_;
};

/// The smallest box around a shape placed by `placement`; a mesh's is that of its turned box, somewhat larger.
Extents extents_of(const PreparedShape& shape, const Placement& placement);

}  // namespace ringfence::reference
