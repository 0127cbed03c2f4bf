#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "reference/vector.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::reference_test {

using reference::Vector;

/// Random shapes, directions and orientations for tests: ordinary ones and those on which geometry code tends to fail.
/// Lengths are in metres. In one build, equal seeds give equal sequences. Threads: one at a time.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// Uniform in [low, high).
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  /// 0 to n - 1.
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(engine_() % n); }
  /// True with probability 1 / n.
  bool one_in(std::size_t n) { return below(n) == 0; }
  /// Uniform in the logarithm, from `low` to `high`. Precondition: both are positive.
  double size(double low, double high) { return low * std::pow(high / low, uniform(0, 1)); }

  /// A unit vector.
  Vector direction() {
    for (;;) {
      const Vector v{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
      const double l = length(v);
      if (l > 0.1 && l <= 1) return v * (1 / l);
    }
  }

  Quat orientation() {
    const Vector axis = direction();
    const double half = uniform(0, 3.14159265358979);
    return {static_cast<float>(axis.x * std::sin(half)), static_cast<float>(axis.y * std::sin(half)),
            static_cast<float>(axis.z * std::sin(half)), static_cast<float>(std::cos(half))};
  }
  /// An orientation that maps axes to axes, so that faces and edges of two boxes are parallel.
  Quat square_orientation() {
    const float h = 0.70710678f;
    const Quat all[] = {{0, 0, 0, 1}, {1, 0, 0, 0}, {0, 1, 0, 0},  {h, 0, 0, h},
                        {0, h, 0, h}, {0, 0, h, h}, {0, 0, -h, h}, {0.5f, 0.5f, 0.5f, 0.5f}};
    return all[below(8)];
  }

  Vec3f vec3f(const Vector& v) { return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)}; }

  Sphere sphere(double size) { return {static_cast<float>(size * uniform(0.5, 1))}; }
  Capsule capsule(double size) {
    return {static_cast<float>(size * uniform(0.3, 0.6)),
            one_in(6) ? 0.0f : static_cast<float>(size * uniform(0.1, 0.6))};
  }
  Box box(double size) {
    return {vec3f({size * uniform(0.3, 0.7), size * uniform(0.3, 0.7), size * uniform(0.3, 0.7)})};
  }
  /// A hull of points on an ellipsoid with semi-axes of `size` / 2 to `size`.
  ConvexHull hull(double size, std::size_t points) {
    const Vector scale{size * uniform(0.5, 1), size * uniform(0.5, 1), size * uniform(0.5, 1)};
    ConvexHull out;
    for (std::size_t i = 0; i < points; ++i) {
      const Vector d = direction();
      out.points.push_back(vec3f({d.x * scale.x, d.y * scale.y, d.z * scale.z}));
    }
    return out;
  }
  /// A hull that is hard for geometry code: many points in one plane, duplicate points, points inside, a plate, a
  /// needle, a prism, or an origin far outside.
  ConvexHull degenerate_hull(double size) {
    ConvexHull out;
    Vector scale{size, size, size};
    Vector shift;
    switch (below(6)) {
      case 0:  // a lattice: every face holds many points
        for (int i = 0; i < 27; ++i) out.points.push_back(vec3f(size * Vector(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)));
        return out;
      case 1:
        scale.z = size * 1e-3;
        break;
      case 2:
        scale.x = scale.y = size * 1e-3;
        break;
      case 3:
        shift = direction() * (size * 20);
        break;
      case 4: {  // a prism of many sides
        const std::size_t sides = 3 + below(30);
        for (std::size_t i = 0; i < sides; ++i) {
          const double angle = 6.283185307179586 * static_cast<double>(i) / static_cast<double>(sides);
          for (const double z : {-0.3, 0.3}) {
            out.points.push_back(vec3f(size * Vector(std::cos(angle), std::sin(angle), z)));
          }
        }
        return out;
      }
      default:
        break;
    }
    const std::size_t points = 4 + below(40);
    for (std::size_t i = 0; i < points; ++i) {
      const Vector d = direction() * uniform(0.5, 1);
      out.points.push_back(vec3f(Vector{d.x * scale.x, d.y * scale.y, d.z * scale.z} + shift));
    }
    out.points.push_back(out.points.front());
    return out;
  }
  /// A box in which each side has `size` or a thousandth of it as half extent.
  Box degenerate_box(double size) {
    const auto thin = [&] { return one_in(2) ? size : size * 1e-3; };
    return {vec3f({thin(), thin(), thin()})};
  }

  /// Either a closed sphere of varying radius with 4 * rings^2 triangles, or rings^2 separate triangles.
  TriangleMesh mesh(double size, int rings) {
    TriangleMesh out;
    if (one_in(2)) {
      for (int i = 0; i < rings * rings; ++i) {
        const Vector centre = direction() * (size * uniform(0, 1));
        for (int k = 0; k < 3; ++k) {
          out.indices.push_back(static_cast<std::uint32_t>(out.vertices.size()));
          out.vertices.push_back(vec3f(centre + direction() * (size * 0.3)));
        }
      }
      return out;
    }
    const auto around = static_cast<std::uint32_t>(2 * rings);
    for (std::uint32_t i = 0; i <= static_cast<std::uint32_t>(rings); ++i) {
      for (std::uint32_t j = 0; j < around; ++j) {
        const double up = 3.14159265358979 * i / rings, turn = 6.283185307179586 * j / around;
        const double r = size * uniform(0.8, 1);
        out.vertices.push_back(
            vec3f({r * std::sin(up) * std::cos(turn), r * std::sin(up) * std::sin(turn), r * std::cos(up)}));
      }
    }
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(rings); ++i) {
      for (std::uint32_t j = 0; j < around; ++j) {
        const std::uint32_t p = i * around + j, q = i * around + (j + 1) % around;
        out.indices.insert(out.indices.end(), {p, q, p + around, q, q + around, p + around});
      }
    }
    return out;
  }

  /// A sphere, capsule, box or hull. One in four boxes and hulls is degenerate.
  ShapeDescription convex(double size) {
    const bool degenerate = one_in(4);
    switch (below(4)) {
      case 0:
        return sphere(size);
      case 1:
        return capsule(size);
      case 2:
        return degenerate ? degenerate_box(size) : box(size);
      default:
        return degenerate ? degenerate_hull(size) : hull(size, 4 + below(60));
    }
  }

 private:
  std::mt19937_64 engine_;
};

/// `pose` after the rigid motion `motion`: a rotation about the origin of the world, then a translation.
inline Pose moved(const Pose& pose, const Pose& motion) {
  const auto turn = reference::rotation_of(motion.orientation);
  const Quat &p = motion.orientation, &q = pose.orientation;
  Pose out;
  out.position = turn * Vector(pose.position) + Vector(motion.position);
  out.orientation = {p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y, p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
                     p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w, p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z};
  return out;
}

}  // namespace ringfence::reference_test
