#pragma once

#include "picture/drawing.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::tools {

/// How a world is shown from above: its x axis to the right, its y axis up, in the largest scale at which its bounds
/// fit the picture.
class View {
 public:
  View(Vec3d min, Vec3d max);

  /// The bounds of the world in the drawing.
  const Rectangle& map() const noexcept { return map_; }
  double width() const noexcept { return map_.max.x - map_.min.x; }
  double height() const noexcept { return map_.max.y - map_.min.y; }
  /// Pixels for each metre.
  double scale() const noexcept { return scale_; }
  Point operator()(Vec3d position) const noexcept {
    return {map_.min.x + (position.x - min_.x) * scale_, map_.max.y - (position.y - min_.y) * scale_};
  }
  /// The length of the scale bar: 1, 2 or 5 times a power of ten, at most a quarter of the map, metres.
  double bar_metres() const noexcept;

 private:
  Vec3d min_;
  double scale_;
  Rectangle map_;
};

}  // namespace ringfence::tools
