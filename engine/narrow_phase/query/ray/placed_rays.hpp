#pragma once

#include <cstddef>
#include <cstdint>

#include "narrow_phase/query/ray/local_ray.hpp"

namespace ringfence::narrow_phase {

/// Rays on the axes of many shapes, each with its own: what LocalRay and rotation_exact() compute, in SIMD, with the
/// same bits at every width.
///
/// Threads: belongs to one. Memory: 15 kB, no allocation.
class PlacedRays {
 public:
  static constexpr std::size_t most = 64;  ///< rays

  /// Adds a ray and the shape to whose axes it is converted. `size`: radius of a ball around the shape's origin, as of
  /// LocalRay. Precondition: there are fewer than `most`.
  void add(const Ray& ray, const Pose& pose, double size) noexcept;
  /// Computes what the functions below return for the rays that were added since the run before.
  void run() noexcept;

  /// Whether the line of the i-th ray misses the ball around the shape.
  bool misses(std::size_t i) const noexcept { return (misses_ >> i & 1) != 0; }
  LocalRay ray(std::size_t i) const noexcept;
  /// From the axes of the shape to the world's.
  geometry::RotationD rotation(std::size_t i) const noexcept;
  Pose pose(std::size_t i) const noexcept;  ///< of the shape

  /// Vectors as columns.
  struct Columns {
    alignas(64) double x[most], y[most], z[most];

    void set(std::size_t i, const Vec3d& p) noexcept { x[i] = p.x, y[i] = p.y, z[i] = p.z; }
    Vec3d at(std::size_t i) const noexcept { return {x[i], y[i], z[i]}; }
  };
  /// Rays and shapes as columns.
  struct In {
    Columns position, start, direction;
    alignas(64) float orientation[4][most];  ///< x, y, z, w
    alignas(64) double size[most], length[most];
  };
  /// What is computed.
  struct Out {
    Columns origin, direction, foot;
    alignas(64) double begin[most], slack[most];
    alignas(64) double rotation[3][3][most];
  };

 private:
  std::size_t size_ = 0;
  std::uint64_t misses_ = 0;
  In in_{};
  Out out_;
};

}  // namespace ringfence::narrow_phase
