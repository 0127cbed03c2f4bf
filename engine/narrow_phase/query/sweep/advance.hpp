#pragma once

#include <algorithm>

#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {

/// A plane between a fixed shape and a moving one, proven by their farthest points.
struct Gap {
  bool touch = false;   ///< the shapes overlap or touch; the other fields are not valid
  bool beyond = false;  ///< the shapes are farther apart than the moving one moves; the other fields are not valid
  double width = 0;     ///< metres along `normal` between the shapes
  Vec3d normal;         ///< unit, from the fixed shape to the moving one, nearly along the shortest connection
  Vec3d on_fixed;       ///< the nearest point of the fixed shape
};

/// How a sweep ends.
struct SweepContact {
  enum class Kind { none, inside, touch };
  Kind kind = Kind::none;
  double place = 0;  ///< metres along the direction
  Vec3d normal;      ///< touch: unit, from the fixed shape to the moving one
  Vec3d point;       ///< touch: where the surfaces touch
};

/// Maximum number of planes of a sweep. Few sweeps need more than 8; those that graze a curved surface up to about 30,
/// since each step there halves what is left of the way.
inline constexpr int most_sweep_steps = 96;

/// Moves a shape along the unit vector `direction` from the place `begin` until it touches a fixed shape, at `end` at
/// most. `gap_at(place)` returns a Gap; `tolerance`, metres, is a width at which its normal is still precise, and far
/// below the accuracy that is needed.
///
/// Each plane proves that there is no contact before the place where the moving shape crosses it. So no contact is
/// missed, and the shapes are at most 4 * `tolerance` apart where a contact is reported. `end` only discards
/// contacts, and changes none. A shape that moves along a surface or away from it does not touch it. Method:
/// conservative advancement along the separating axis (Mirtich 1996), which is Newton's method on the distance, a
/// convex function of the place; like the GJK ray cast (van den Bergen 2004), but on top of complete distance
/// computations. If the steps run out, the shapes touch if their gap is at most 4 * `tolerance`. Where rounding
/// lets the shapes touch too early, the sweep returns halfway and doubles the tolerance.
template <class GapAt>
SweepContact advance(const GapAt& gap_at, const Vec3d& direction, double begin, double end, double tolerance) {
  SweepContact out;
  double before = begin;   // the last place with a gap
  double touched = begin;  // a contact is reported no earlier, so that `end` decides in one way
  out.place = begin;
  for (int step = 0; step < most_sweep_steps; ++step) {
    const Gap gap = gap_at(out.place);
    if (gap.touch) {
      out.kind = step == 0 ? SweepContact::Kind::inside : SweepContact::Kind::touch;
      if (step == 0) return out;
      // Rounding at a contact: a normal is computed farther away from it. If the steps run out, the last one holds.
      touched = std::max(touched, out.place);
      out.place = before + 0.5 * (out.place - before);
      tolerance *= 2;
      continue;
    }
    if (gap.beyond) return {};
    const double approach = -dot(gap.normal, direction);
    out.kind = SweepContact::Kind::none;
    if (!(approach > 0)) break;
    before = out.place;
    out.normal = gap.normal;
    out.point = gap.on_fixed;
    if (gap.width <= tolerance || (step == most_sweep_steps - 1 && gap.width <= 4 * tolerance)) {
      out.place = std::max(touched, out.place + std::clamp(gap.width / approach, 0.0, 4 * tolerance));
      if (out.place <= end) out.kind = SweepContact::Kind::touch;
      return out;
    }
    // The next plane is computed where the gap is still wide enough for a precise normal. A contact is not before it.
    out.place += (gap.width - 0.5 * tolerance) / approach;
    if (out.place > end) break;
  }
  return out;
}

}  // namespace ringfence::narrow_phase
