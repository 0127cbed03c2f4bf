#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "narrow_phase/query/mesh_boxes.hpp"

namespace ringfence::narrow_phase {

/// The interval of a line in boxes, which are widened by a margin against rounding.
///
/// The interval of a box within another is within the other's, also as computed: each operation is monotonic.
class LineInBox {
 public:
  /// `margin`: at least 10^-15 of the coordinates involved, metres.
  LineInBox(const Vec3d& foot, const Vec3d& direction, const Vec3d& margin) noexcept
      : foot_(foot),
        inverse_{inverse_of(direction.x), inverse_of(direction.y), inverse_of(direction.z)},
        margin_(margin) {}

  /// Places where the line enters and leaves a box; if enter > leave, it misses the box.
  struct Interval {
    double enter, leave;
  };
  Interval operator()(const CornerBox& box) const noexcept {
    const Vec3d low = (box.lower - margin_) - foot_, high = (box.upper + margin_) - foot_;
    const Vec3d p{low.x * inverse_.x, low.y * inverse_.y, low.z * inverse_.z};
    const Vec3d q{high.x * inverse_.x, high.y * inverse_.y, high.z * inverse_.z};
    return {std::max({std::min(p.x, q.x), std::min(p.y, q.y), std::min(p.z, q.z)}),
            std::min({std::max(p.x, q.x), std::max(p.y, q.y), std::max(p.z, q.z)})};
  }
  /// Where the line enters the box; infinity if the part of the line from `begin` on misses it.
  double enter(const CornerBox& box, double begin) const noexcept {
    const Interval found = (*this)(box);
    return found.enter <= found.leave && found.leave >= begin ? found.enter : std::numeric_limits<double>::infinity();
  }

 private:
  /// Large instead of infinite, so that a product with zero is zero. A slab that contains the foot then contains all of
  /// the line that matters.
  static double inverse_of(double slope) noexcept {
    constexpr double least = 1e-200;
    return 1 / (std::abs(slope) > least ? slope : std::copysign(least, slope));
  }

  Vec3d foot_, inverse_, margin_;
};

}  // namespace ringfence::narrow_phase
