#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/queries/all_objects.hpp"
#include "facade/queries/sensing_model.hpp"

namespace ringfence::test {

/// Compares what objects sensed in a frame with tests of every object of the frame before.
class SensesCheck {
 public:
  explicit SensesCheck(double sense) : sense_(sense) {}

  /// `objects`: all of the frame before.
  void check(const SensedByObject& sensed, const AllObjects& objects) {
    const Queries queries{{sensed.ray}, {sensed.sweep}, {sensed.overlap}, {sensed.nearest}};
    const std::vector<Hit> all = objects.answer(queries).hits;
    const double ray = reach(sensed, sensed.ray.start, sensed.ray.displacement);
    if (judge(sensed.cast.status, ray, ray)) CHECK(sensed.cast == all[0]);
    // The last element says whether the ray hits anything.
    if (judge(sensed.any.status, ray, ray)) CHECK(sensed.any.hit == (all.back().triangle != 0));
    const double sweep = reach(sensed, sensed.sweep.start.position, sensed.sweep.displacement);
    const auto radii = [](ShapeId shape) {
      return std::pair(SensingModel::least_radius[shape.number()], SensingModel::most_radius[shape.number()]);
    };
    const auto [least, most] = radii(sensed.sweep.shape);
    if (judge(sensed.swept.status, sweep + least, sweep + most)) CHECK(sensed.swept == all[1]);
    const double point = reach(sensed, sensed.nearest.point, {}) + sensed.nearest.distance;
    if (judge(sensed.near.status, point, point)) CHECK(sensed.near == all[2]);
    const double overlap = reach(sensed, sensed.overlap.pose.position, {});
    const auto [least_overlap, most_overlap] = radii(sensed.overlap.shape);
    if (judge(sensed.overlap_status, overlap + least_overlap, overlap + most_overlap)) {
      // Before the last element is the list of the overlap, which an empty hit ends.
      std::size_t end = all.size() - 2, first = end;
      while (all[first - 1]) --first;
      CHECK(std::equal(sensed.overlaps.begin(), sensed.overlaps.end(), all.begin() + static_cast<std::ptrdiff_t>(first),
                       all.begin() + static_cast<std::ptrdiff_t>(end)));
      found += sensed.overlaps.size();
    }
    for (const Hit* hit : {&sensed.cast, &sensed.swept, &sensed.near}) found += *hit ? 1 : 0;
  }

  std::size_t answered = 0, refused = 0, found = 0;

 private:
  static double reach(const SensedByObject& sensed, const Vec3d& start, const Vec3d& displacement) {
    const Vec3d& at = sensed.position;
    return std::max(
        std::hypot(start.x - at.x, start.y - at.y, start.z - at.z),
        std::hypot(start.x + displacement.x - at.x, start.y + displacement.y - at.y, start.z + displacement.z - at.z));
  }
  /// Whether the query is answered; it is if it certainly reaches less far than the models may ask.
  bool judge(Status status, double least, double most) {
    CHECK((status == Status::ok || status == Status::beyond_sense));
    if (most < sense_ - 1e-9) CHECK(status == Status::ok);
    if (least > sense_ + 1e-9) CHECK(status == Status::beyond_sense);
    ++(status == Status::ok ? answered : refused);
    return status == Status::ok;
  }

  double sense_;
};

}  // namespace ringfence::test
