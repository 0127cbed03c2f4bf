#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "reference/vector.hpp"

namespace ringfence::reference {

/// The surface of a convex hull in triangles, grown point by point.
///
/// Every decision is exact (see orientation), so there is no input on which it comes apart; points inside or on the
/// surface change nothing. Faces in one plane stay separate triangles.
/// Cost: a step a face for each point. Memory: points and faces.
class ConvexSurface {
 public:
  struct Face {
    std::uint32_t vertices[3];  ///< indices into points(), anticlockwise seen from outside
    Vector normal;              ///< unit, outwards
    double offset = 0;          ///< normal · x on the face; infinite if the area rounds to zero (normal zero then)
  };

  /// The hull of `points`; none if all of them lie in one plane (exactly).
  static std::optional<ConvexSurface> around(std::span<const Vector> points);

  /// Grows the hull by a point. False if it lies inside or on the surface.
  bool add(const Vector& point);

  /// Makes the offset of a face infinite, so that a search for the nearest face passes it by.
  void exclude_face(std::size_t face) { faces_[face].offset = std::numeric_limits<double>::infinity(); }

  /// All points ever added on the surface, also those that a later one has covered.
  std::span<const Vector> points() const { return points_; }
  std::span<const Face> faces() const { return faces_; }

 private:
  ConvexSurface() = default;
  void add_face(std::uint32_t i, std::uint32_t j, std::uint32_t k);

  std::vector<Vector> points_;
  std::vector<Face> faces_;
  std::vector<std::uint64_t> edges_;  // of the faces that a point sees; kept for its capacity
};

}  // namespace ringfence::reference
