#include "queries/interpolate.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/vector.hpp"

namespace ringfence::queries {

Pose interpolate(const Pose& from, const Pose& to, double fraction) noexcept {
  Pose out = from;
  if (fraction <= 0 || from == to) return out;
  out.position = from.position + (to.position - from.position) * fraction;
  const double p[4] = {from.orientation.x, from.orientation.y, from.orientation.z, from.orientation.w};
  const double q[4] = {to.orientation.x, to.orientation.y, to.orientation.z, to.orientation.w};
  // The quaternions q and -q are the same rotation; the nearer one gives the shorter way.
  const double along = (p[0] * q[0] + p[1] * q[1]) + (p[2] * q[2] + p[3] * q[3]);
  const double to_share = along < 0 ? -fraction : fraction, from_share = 1 - fraction;
  double mixed[4], squares = 0;
  for (int i = 0; i < 4; ++i) {
    mixed[i] = from_share * p[i] + to_share * q[i];
    squares += mixed[i] * mixed[i];
  }
  // Of two quaternions at most a right angle apart, no mean is shorter than 0.7.
  const double scale = 1 / std::sqrt(squares);
  out.orientation = {static_cast<float>(mixed[0] * scale), static_cast<float>(mixed[1] * scale),
                     static_cast<float>(mixed[2] * scale), static_cast<float>(mixed[3] * scale)};
  return out;
}

double turn_cosine(const Quat& from, const Quat& to) noexcept {
  const double dot = (double{from.x} * double{to.x} + double{from.y} * double{to.y}) +
                     (double{from.z} * double{to.z} + double{from.w} * double{to.w});
  return std::min(std::abs(dot), 1.0);
}

// A curve whose second derivative is at most m is at most m / 8 from the straight line. With t the tangent of a quarter
// of the turn, the quaternion of interpolate() turns by at most 2 t for each unit of the fraction, and this speed
// changes by at most 8 t^3. A point turns twice as fast: its second derivative is at most (4 t)^2 + 16 t^3.
double most_bulge(double turn_cosine) noexcept {
  const double squared_tangent = (1 - turn_cosine) / (1 + turn_cosine);
  return 2 * squared_tangent * (1 + std::sqrt(squared_tangent));
}

}  // namespace ringfence::queries
