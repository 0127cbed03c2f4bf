#include "geometry/bounds.hpp"

#include <cmath>
#include <string>

#include "ringfence/error.hpp"

namespace ringfence::geometry {
namespace {

constexpr double steps = 4294967296.0;
constexpr double max_step = 4294967295.0;

double steps_per_metre(const char* axis, double min, double& max) {
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
  return steps / (max - min);
}

double clamp_step(double step) noexcept {
  const double positive = step > 0.0 ? step : 0.0;
  return positive < max_step ? positive : max_step;
}

std::uint32_t rounded_up(double step) noexcept {
  const double inside = clamp_step(step);
  const auto whole = static_cast<std::int64_t>(inside);
  return static_cast<std::uint32_t>(whole + (static_cast<double>(whole) < inside ? 1 : 0));
}

}  // namespace

FixedSpace::FixedSpace(Vec3d min, Vec3d max) : rows_{{min.x, min.y, min.z, 0}, {}}, max_(max) {
  rows_.scale[0] = steps_per_metre("x", min.x, max_.x);
  rows_.scale[1] = steps_per_metre("y", min.y, max_.y);
  rows_.scale[2] = steps_per_metre("z", min.z, max_.z);
}

Bounds FixedSpace::bounds(Vec3d min, Vec3d max) const noexcept {
  const auto at = [this](double place, int axis) { return (place - rows_.min[axis]) * rows_.scale[axis]; };
  return {{rounded_down(at(min.x, 0)), rounded_down(at(min.y, 1)), rounded_down(at(min.z, 2))},
          {rounded_up(at(max.x, 0)), rounded_up(at(max.y, 1)), rounded_up(at(max.z, 2))}};
}

}  // namespace ringfence::geometry
