#include "narrow_phase/query/ray/triangle_ray.hpp"

#include <cmath>

#include "narrow_phase/query/double_double.hpp"
#include "narrow_phase/query/simplex.hpp"

namespace ringfence::narrow_phase {
namespace {

double size_of(const Triple<double>& p) noexcept { return std::abs(p.x) + std::abs(p.y) + std::abs(p.z); }
double size_of(const Triple<DoubleDouble>& p) noexcept {
  return std::abs(p.x.high) + std::abs(p.y.high) + std::abs(p.z.high);
}

DoubleDouble difference(double p, double q, DoubleDouble) noexcept { return exact::sum(p, -q); }
double difference(double p, double q, double) noexcept { return p - q; }

template <class T>
Triple<T> difference(const Vec3d& p, const Vec3d& q) noexcept {
  return {difference(p.x, q.x, T()), difference(p.y, q.y, T()), difference(p.z, q.z, T())};
}

/// A crossing relative to what rounding does to its decisions.
enum class Crossing { none, found, not_precise };

/// `unit` bounds the rounding error of a triple product relative to the lengths of its factors. The result is precise
/// if the volume exceeds its error by `certain`.
template <class T>
Crossing test_crossing(const Vec3d& foot, const Vec3d& direction, const Vec3d& a, const Vec3d& b, const Vec3d& c,
                       double unit, double certain, TriangleCrossing& out) noexcept {
  const Triple<T> along{T(direction.x), T(direction.y), T(direction.z)};
  const Triple<T> ab = difference<T>(b, a), ac = difference<T>(c, a), from_a = difference<T>(foot, a);
  const Triple<T> across = cross(along, ac);
  T volume = dot(ab, across), at_b = dot(from_a, across);
  const Triple<T> q = cross(from_a, ab);
  T at_c = dot(along, q);
  const double size_ab = size_of(ab), size_ac = size_of(ac);
  const double error = unit * (size_of(from_a) * (size_ab + size_ac) + size_ab * size_ac);
  const bool front = volume > T(0.0);
  if (!front) volume = -volume, at_b = -at_b, at_c = -at_c;
  const T outside = T(-error);
  if (at_b < outside || at_c < outside || volume - at_b - at_c < outside) return Crossing::none;
  if (!(volume > T(certain * error))) return Crossing::not_precise;
  const T place = dot(ac, q) / volume;
  out.place = static_cast<double>(front ? place : -place);
  out.front = front;
  return Crossing::found;
}

}  // namespace

bool cross_triangle(const Vec3d& foot, const Vec3d& direction, const Vec3d& a, const Vec3d& b, const Vec3d& c,
                    TriangleCrossing& out) noexcept {
  const Crossing first = test_crossing<double>(foot, direction, a, b, c, 0x1p-49, 0x1p24, out);
  if (first != Crossing::not_precise) return first == Crossing::found;
  return test_crossing<DoubleDouble>(foot, direction, a, b, c, 0x1p-96, 0x1p30, out) == Crossing::found;
}

}  // namespace ringfence::narrow_phase
