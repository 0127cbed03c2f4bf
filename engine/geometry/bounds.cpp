#include "geometry/bounds.hpp"

#include <bit>
#include <cmath>
#include <string>

#include "geometry/outer_steps.hpp"
#include "geometry/vector.hpp"
#include "ringfence/error.hpp"

namespace ringfence::geometry {
namespace {

constexpr double max_step = 4294967295.0;

double side_of(const char* axis, double min, double& max) {
  if (!std::isfinite(min) || !std::isfinite(max) || !std::isfinite(max - min)) {
    throw Error(std::string("world bounds: ") + axis + " is not finite; give finite bounds in metres");
  }
  if (min > max) {
    throw Error(std::string("world bounds: min exceeds max on ") + axis + " (" + std::to_string(min) + " > " +
                std::to_string(max) + "); swap them");
  }
  if (max - min < 1.0) max = min + 1.0;
  if (!(max > min)) {
    throw Error(std::string("world bounds: ") + axis + " starts too far from the origin for a side of 1 m");
  }
  return max - min;
}

double clamp_step(double step) noexcept {
  const double positive = step > 0.0 ? step : 0.0;
  return positive < max_step ? positive : max_step;
}

std::uint32_t step_rounded_up(double step) noexcept {
  const double inside = clamp_step(step);
  const auto whole = static_cast<std::int64_t>(inside);
  return static_cast<std::uint32_t>(whole + (static_cast<double>(whole) < inside ? 1 : 0));
}

}  // namespace

FixedSpace::FixedSpace(Vec3d min, Vec3d max, Outside outside) : rows_{}, min_(min), max_(max) {
  const double sides[3] = {side_of("x", min.x, max_.x), side_of("y", min.y, max_.y), side_of("z", min.z, max_.z)};
  const double lower[3] = {min.x, min.y, min.z};
  const bool octaves = outside == Outside::has_octaves;
  for (int axis = 0; axis < 4; ++axis) {
    rows_.first[axis] = octaves && axis < 3 ? outer_steps : -infinity;
    rows_.last[axis] = octaves ? all_steps - outer_steps : infinity;
  }
  for (int axis = 0; axis < 3; ++axis) {
    rows_.scale[axis] = (octaves ? inner_steps : all_steps) / sides[axis];
    rows_.min[axis] = octaves ? lower[axis] - outer_steps / rows_.scale[axis] : lower[axis];
  }
}

// The number of sides beyond the bounds plus 1 is a double whose exponent is the octave, and whose highest bits of the
// mantissa are the step in it.
double FixedSpace::Rows::outer_step(double step) const noexcept {
  const bool below = step < first[0];
  const double sides = 1.0 + (below ? first[0] - step : step - last[0]) * (1 / inner_steps);
  const std::uint64_t whole = std::bit_cast<std::uint64_t>(sides) >> (52 - octave_log2);
  const auto beyond = static_cast<double>(whole - (std::uint64_t{1023} << octave_log2));
  return below ? first[0] - beyond : last[0] + beyond;
}

Bounds FixedSpace::bounds(Vec3d min, Vec3d max) const noexcept {
  return {{rounded_down(rows_.step_at(min.x, 0)), rounded_down(rows_.step_at(min.y, 1)),
           rounded_down(rows_.step_at(min.z, 2))},
          {step_rounded_up(rows_.step_at(max.x, 0)), step_rounded_up(rows_.step_at(max.y, 1)),
           step_rounded_up(rows_.step_at(max.z, 2))}};
}

}  // namespace ringfence::geometry
