#include <cmath>

#include "geometry/vector.hpp"
#include "queries/frame_object.hpp"

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

}  // namespace ringfence::queries
