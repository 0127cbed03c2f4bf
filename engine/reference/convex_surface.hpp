#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "reference/vector.hpp"

namespace ringfence::reference {

/// The surface of a convex hull as triangles, grown one point at a time.
///
/// Every decision is exact (see orientation), so the surface stays closed and convex for all inputs. Points inside or
/// on the surface change nothing. Coplanar faces stay separate triangles.
/// Cost: one step per face for each point. Memory: points and faces.
class ConvexSurface {
 public:
  struct Face {
    std::uint32_t vertices[3];  ///< indices into points(), anticlockwise as seen from outside
    Vector normal;              ///< unit, outwards; zero if the area rounds to zero
    double offset = 0;          ///< normal · x on the face; infinite if the area rounds to zero
  };

  /// The hull of `points`; none if all of them lie exactly in one plane.
  static std::optional<ConvexSurface> around(std::span<const Vector> points);

  /// Grows the hull by a point. Returns false if the point lies inside or on the surface.
  bool add(const Vector& point);

  /// Makes the offset of a face infinite, so that a search for the nearest face skips it.
  void exclude_face(std::size_t face) { faces_[face].offset = std::numeric_limits<double>::infinity(); }

  /// All points that were added to the surface, including those that later points have covered.
  std::span<const Vector> points() const { return points_; }
  std::span<const Face> faces() const { return faces_; }

 private:
  ConvexSurface() = default;
  void add_face(std::uint32_t i, std::uint32_t j, std::uint32_t k);

  std::vector<Vector> points_;
  std::vector<Face> faces_;
  std::vector<std::uint64_t> edges_;  // edges of the faces that a point sees; a member to reuse its memory
};

}  // namespace ringfence::reference
