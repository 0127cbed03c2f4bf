#include "picture/view.hpp"

#include <algorithm>
#include <cmath>

namespace ringfence::tools {
namespace {

constexpr double widest = 760, highest = 720;  // of the map
constexpr double left = 24, top = 72;
constexpr double least_side = 1;  // World extends shorter sides, metres

}  // namespace

View::View(Vec3d min, Vec3d max) : min_(min) {
  const double across = std::max(least_side, max.x - min.x), along = std::max(least_side, max.y - min.y);
  scale_ = std::min(widest / across, highest / along);
  map_ = {{left, top}, {left + across * scale_, top + along * scale_}};
}

double View::bar_metres() const noexcept {
  const double most = width() / scale_ / 4;
  double length = std::pow(10, std::floor(std::log10(most)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * length <= most) return factor * length;
  }
  return length;
}

}  // namespace ringfence::tools
