#include "geometry/bounds.hpp"

#include <cmath>
#include <string>

#include "ringfence/error.hpp"

namespace ringfence::geometry {
namespace {

constexpr double steps = 4294967296.0;
constexpr double last_step = 4294967295.0;

double steps_a_metre(const char* axis, double min, double& max) {
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

double saturated(double step) noexcept {
  const double positive = step > 0.0 ? step : 0.0;
  return positive < last_step ? positive : last_step;
}

// Casting truncates, which is rounding down here: no call of floor, which needs more than the oldest instruction set.
std::uint32_t rounded_down(double step) noexcept {
  return static_cast<std::uint32_t>(static_cast<std::int64_t>(saturated(step)));
}

std::uint32_t rounded_up(double step) noexcept {
  const double inside = saturated(step);
  const auto whole = static_cast<std::int64_t>(inside);
  return static_cast<std::uint32_t>(whole + (static_cast<double>(whole) < inside ? 1 : 0));
}

}  // namespace

FixedSpace::FixedSpace(Vec3d min, Vec3d max) : min_(min), max_(max) {
  scale_ = {steps_a_metre("x", min.x, max_.x), steps_a_metre("y", min.y, max_.y), steps_a_metre("z", min.z, max_.z)};
}

Bounds FixedSpace::bounds(Vec3d min, Vec3d max) const noexcept {
  return {{rounded_down((min.x - min_.x) * scale_.x), rounded_down((min.y - min_.y) * scale_.y),
           rounded_down((min.z - min_.z) * scale_.z)},
          {rounded_up((max.x - min_.x) * scale_.x), rounded_up((max.y - min_.y) * scale_.y),
           rounded_up((max.z - min_.z) * scale_.z)}};
}

void FixedSpace::point(Vec3d position, std::uint32_t out[3]) const noexcept {
  out[0] = rounded_down((position.x - min_.x) * scale_.x);
  out[1] = rounded_down((position.y - min_.y) * scale_.y);
  out[2] = rounded_down((position.z - min_.z) * scale_.z);
}

}  // namespace ringfence::geometry
