#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/convex_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/convex_overlap-inl.hpp"
#include "narrow_phase/convex_round-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Where a shape's polytope comes from.
struct FromHull {
  const Polytope polytope;
  FromHull(const geometry::ShapeTable& shapes, const geometry::ShapeRow& row)
      : polytope(polytope_of(shapes.hull(row.detail))) {}
  const Polytope& get() const { return polytope; }
};
struct FromBox {
  const BoxPolytope box;
  FromBox(const geometry::ShapeTable&, const geometry::ShapeRow& row) : box(row.size) {}
  const Polytope& get() const { return box.polytope(); }
};

/// How the second body lies in the axes of the first; of a round pair, only what `write` needs.
template <class T>
struct Relative {
  Turn<T> first, turn{};
  Point<T> offset{};      ///< in the axes of the first
  Point<T> offset_world;  ///< in the world's

  HWY_INLINE Relative(const Turn<T>& axes, Point<T> between) : first(axes), offset_world(between) {}
  HWY_INLINE Relative(const Pose& p, const Pose& q)
      : first(turn_of<T>(p.orientation)), offset_world(difference_of<T>(q.position, p.position)) {
    const Turn<T> second = turn_of<T>(q.orientation);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        turn.m[i][j] =
            (first.m[0][i] * second.m[0][j] + first.m[1][i] * second.m[1][j]) + first.m[2][i] * second.m[2][j];
      }
    }
    offset = rotate_back(first, offset_world);
  }
};

/// Writes what was found in the axes of the first body, turned to the pair's own a and b.
template <class T>
HWY_INLINE PairContact* write(const KernelPair& pair, const Relative<T>& relative, const Overlap<T>& found,
                              PairContact* out) {
  Point<T> normal = rotate(relative.first, found.normal), point = rotate(relative.first, found.point);
  if (pair.flipped != 0) {
    normal = -normal;
    point = point - relative.offset_world;
  }
  // Adding zero makes every zero positive, so that no bit depends on how it came about.
  const auto plain = [](T value) { return static_cast<float>(value) + 0.0f; };
  *out = {pair.pair,
          plain(found.depth),
          {plain(normal.x), plain(normal.y), plain(normal.z)},
          {plain(point.x), plain(point.y), plain(point.z)}};
  return out + 1;
}

template <class T, class First, class Second>
PairContact* run_polytopes(const KernelInput& input, PairContact* out, KindCounters& counters) {
  for (const KernelPair& pair : input.pairs) {
    begin_gathering(input);
    const Body& first = input.bodies[pair.first];
    const Body& second = input.bodies[pair.second];
    const First p(input.shapes, input.shapes.row(first.shape));
    const Second q(input.shapes, input.shapes.row(second.shape));
    const Relative<T> relative(first.pose, second.pose);
    end_gathering(input);
    PolytopePair<T> overlap(p.get(), q.get(), relative.turn, relative.offset);
    Overlap<T> found;
    if (overlap.test(found)) out = write(pair, relative, found, out);
    overlap.work().add_to(counters);
  }
  return out;
}

/// A capsule, or a sphere as one of no height, first and a hull second; worked out in the axes of the hull.
template <class T>
HWY_INLINE Answer test_round(const KernelInput& input, const KernelPair& pair, float radius, float half_height,
                             PairContact*& out, KindCounters& counters) {
  begin_gathering(input);
  const Body& round = input.bodies[pair.first];
  const Body& body = input.bodies[pair.second];
  const FromHull hull(input.shapes, input.shapes.row(body.shape));
  const Turn<T> turn = turn_of<T>(body.pose.orientation);
  const Point<T> offset = difference_of<T>(body.pose.position, round.pose.position);
  const Point<T> centre = -rotate_back(turn, offset);
  Point<T> from = centre, to = centre;
  if (half_height > 0) {
    const Turn<T> own = turn_of<T>(round.pose.orientation);
    const Point<T> half = rotate_back(turn, Point<T>{own.m[0][2], own.m[1][2], own.m[2][2]}) * T(half_height);
    from = centre - half;
    to = centre + half;
  }
  end_gathering(input);
  RoundPair<T> core(hull.get(), from, to, T(radius));
  Overlap<T> found;
  const Answer answer = core.test(found);
  core.work().add_to(counters);
  if (answer == Answer::contact) {
    // About the hull's origin so far: to the round body's, which comes first.
    Relative<T> relative(turn, offset);
    found.point = found.point - centre;
    out = write(pair, relative, found, out);
  }
  return answer;
}

PairContact* run_round(const KernelInput& input, PairContact* out, KindCounters& counters) {
  for (const KernelPair& pair : input.pairs) {
    const geometry::ShapeRow& row = input.shapes.row(input.bodies[pair.first].shape);
    const float half_height = row.kind == ShapeKind::capsule ? row.size[1] : 0.0f;
    if (input.in_double || test_round<float>(input, pair, row.size[0], half_height, out, counters) == Answer::unsure) {
      test_round<double>(input, pair, row.size[0], half_height, out, counters);
    }
  }
  return out;
}

PairContact* hull_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return input.in_double ? run_polytopes<double, FromHull, FromHull>(input, out, counters)
                         : run_polytopes<float, FromHull, FromHull>(input, out, counters);
}
PairContact* box_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return input.in_double ? run_polytopes<double, FromBox, FromHull>(input, out, counters)
                         : run_polytopes<float, FromBox, FromHull>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(hull_hull);
HWY_EXPORT(box_hull);
HWY_EXPORT(run_round);

PairContact* test_hull_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(hull_hull)(input, out, counters);
}
PairContact* test_sphere_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(run_round)(input, out, counters);
}
PairContact* test_capsule_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(run_round)(input, out, counters);
}
PairContact* test_box_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(box_hull)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
