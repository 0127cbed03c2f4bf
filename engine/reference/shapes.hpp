#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "reference/core.hpp"
#include "reference/vector.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::reference {

/// An axis-aligned closed box, metres.
struct Extents {
  Vector lower, upper;
};

/// Grows a box so that it holds a point.
void include(Extents& extents, const Vector& point);

/// The smallest box around a placed box.
Extents turned(const Extents& extents, const Placement& placement);

/// The triangles of a mesh in double precision, sorted into compact runs with a box around each.
struct Surface {
  struct Triangle {
    Vector corners[3];
  };
  static constexpr std::size_t run_length = 16;

  std::vector<Triangle> triangles;  ///< without those of zero area; the last run may be shorter
  std::vector<Extents> runs;        ///< around triangles [i * run_length, (i + 1) * run_length)
  Extents extents;                  ///< around all
};

/// A shape prepared for the reference: a convex core, or the triangles of a mesh.
struct PreparedShape {
  ShapeKind kind = ShapeKind::sphere;
  double bounding_radius = 0;  ///< of the smallest ball about the shape's origin that holds the shape, metres
  Core core;                   ///< all kinds but mesh
  Surface surface;             ///< mesh only
};

/// The shapes of a world, prepared for the reference and numbered in the order in which they are added.
///
/// Threads: call `add` before other threads read. Memory: everything in double; hulls include their Gauss map.
class Shapes {
 public:
  Shapes() = default;
  explicit Shapes(std::span<const ShapeDescription> shapes);

  /// Throws std::invalid_argument for a flat hull or a mesh whose triangles all have zero area. Sizes are not checked.
  ShapeNumber add(const ShapeDescription& shape);

  std::size_t size() const noexcept { return shapes_.size(); }
  const PreparedShape& operator[](ShapeNumber shape) const noexcept { return shapes_[shape]; }

 private:
  std::deque<PreparedShape> shapes_;
};

/// The smallest box around a shape placed by `placement`. For a mesh, the box around its rotated box, which is somewhat
/// larger.
Extents extents_of(const PreparedShape& shape, const Placement& placement);

}  // namespace ringfence::reference
