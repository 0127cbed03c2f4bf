// First steps of the test of a box and a hull, for a block of pairs: the line between the centres, and the normals of
// all faces. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_BOX_HULL_FACES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_HULL_FACES_INL
#undef RINGFENCE_NARROW_PHASE_BOX_HULL_FACES_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_HULL_FACES_INL
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "geometry/max_lanes-inl.hpp"
#include "narrow_phase/hull/box_hull_bounds-inl.hpp"
#include "narrow_phase/hull/box_hull_pairs-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Removes the pairs that the line between the centres separates: most pairs that are apart.
HWY_INLINE void separate_by_centres(BoxHullPairs& p) {
  constexpr BoxHullPairs::D d;
  alignas(64) float overlap[block_pairs];
  const auto of_hull = [&](std::size_t i) HWY_ATTR { return highest(*p.hull[i], -p.placed.axis_in_second(i)); };
  for (std::size_t i = 0; i < p.count; i += 4) {
    geometry::HWY_NAMESPACE::max_lanes_of_four(d, of_hull(i), of_hull(i + 1), of_hull(i + 2), of_hull(i + 3),
                                               overlap + i);
  }
  for (std::size_t i = 0; i < p.count; i += BoxHullPairs::lanes) {
    BoxHullPairs::V rest = hn::Neg(hn::LoadU(d, p.placed.along_axis() + i));
    for (int k = 0; k < 3; ++k) rest = rest + hn::Abs(hn::LoadU(d, p.placed.axis(k) + i)) * p.half(k, i);
    hn::Store(rest + hn::Load(d, overlap + i), d, overlap + i);
  }
  for (std::size_t i = 0; i < p.count; ++i) {
    ++p.work.directions;
    p.work.pass<float>(p.hull[i]->vertex_count());
  }
  p.undecided.keep([&](std::size_t i) { return overlap[i] >= 0; });
}

/// Finds the face normal of least overlap for each pair of a block, and removes the pairs that a direction separates.
///
/// Bounds in fixed point select the face of the hull that is evaluated, and seldom another one. For the six faces of
/// the box, the ball inside the hull gives a lower bound; the exact overlap is computed for the one or two that this
/// bound does not exclude.
class BoxHullFaces {
 public:
  BoxHullFaces(BoxHullPairs& pairs, BoxHullBounds& bounds) : pairs_(pairs), bounds_(bounds) {}

  void run() {
    // The lanes of decided pairs are computed too: leftovers on the stack could be slow to compute with.
    set_zero(pairs_.size);
    set_zero(normal_);
    set_zero(ball_);
    // Decided pairs have no overlap.
    for (std::size_t i = 0; i < block_pairs; i += lanes) hn::Store(hn::Set(d, none), d, height_ + i);
    try_faces_of_hull();
    list_faces_of_box();
    evaluate_faces_of_box();
    for (std::size_t i = 0; i < pairs_.count; i += lanes) choose_faces(i);
    pairs_.undecided.keep([&](std::size_t i) { return pairs_.best[i] >= 0; });
  }

 private:
  using D = BoxHullPairs::D;
  using V = BoxHullPairs::V;
  using Column3 = BoxHullPairs::Column3;
  static constexpr D d{};
  static constexpr std::size_t lanes = BoxHullPairs::lanes;
  static constexpr float none = -1e30f;

  /// A face of a box or a hull. Of a box: twice the axis; one more on the negative side.
  struct Item {
    std::uint16_t pair, face;
  };
  static HWY_INLINE Item item(std::size_t pair, std::size_t face) {
    return {static_cast<std::uint16_t>(pair), static_cast<std::uint16_t>(face)};
  }

  /// Finds the normal of the hull's faces with the least overlap.
  void try_faces_of_hull() {
    bounds_.bound_faces();
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) choose_face(pairs_.undecided.pair[u]);
    std::uint32_t uncertain = 0;
    for (std::size_t i = 0; i < pairs_.count; i += lanes) {
      const Vector<D> n = rotate(d, pairs_.placed.rotation_lanes(d, i), load(d, normal_, i));
      const V of_box =
          (hn::Abs(n.x) * pairs_.half(0, i) + hn::Abs(n.y) * pairs_.half(1, i)) + hn::Abs(n.z) * pairs_.half(2, i);
      const V height = hn::Load(d, height_ + i);
      hn::Store(of_box + (height + dot(d, n, pairs_.placed.offset_lanes(d, i))), d, pairs_.best + i);
      uncertain |= (bounds_.uncertain_signs(i, n) & bits_of(d, hn::Gt(height, hn::Set(d, none)))) << i;
    }
    for (; HWY_UNLIKELY(uncertain != 0); uncertain &= uncertain - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(uncertain));
      bounds_.correct_signs(i, face_[i], rotate(pairs_.placed.rotation_of(i), at(normal_, i)));
    }
    for (std::size_t k = 0; k < other_count_; ++k) consider(others_[k]);
  }

  /// Chooses the first face whose bound is the least within the errors. It nearly always has the least overlap.
  HWY_INLINE void choose_face(std::size_t i) {
    const geometry::Hull& hull = *pairs_.hull[i];
    const auto choose_first = [&](std::size_t face) HWY_ATTR {
      face_[i] = static_cast<std::uint32_t>(face);
      put(hull.normal(face), normal_, i);
      height_[i] = hull.offset()[face];
    };
    bounds_.for_each_least(i, choose_first,
                           [&](std::size_t face) HWY_ATTR { others_[other_count_++] = item(i, face); });
    pairs_.size[i] = pairs_.box(i).bounding_radius + hull.bounding_radius();
    ball_[i] = hull.inner_radius();
    pairs_.work.directions += 1;
    pairs_.work.pass<float>(hull.face_count());
  }

  /// Evaluates another face, whose bound is equal within the errors. Among equals the first is chosen.
  void consider(Item item) {
    const std::size_t i = item.pair;
    const geometry::Hull& hull = *pairs_.hull[i];
    const Vec3f normal = hull.normal(item.face), n = rotate(pairs_.placed.rotation_of(i), normal);
    const float of_box =
        (std::abs(n.x) * pairs_.placed.first_size(0)[i] + std::abs(n.y) * pairs_.placed.first_size(1)[i]) +
        std::abs(n.z) * pairs_.placed.first_size(2)[i];
    const float overlap = of_box + (hull.offset()[item.face] + dot(n, pairs_.placed.offset_of(i)));
    if (overlap < pairs_.best[i]) {
      pairs_.best[i] = overlap;
      put(normal, normal_, i);
    }
    bounds_.correct_signs(i, item.face, n);
    ++pairs_.work.directions;
  }

  void list_faces_of_box() {
    for (std::size_t i = 0; i < pairs_.count; i += lanes) {
      const Vector<D> centre = pairs_.hull_centres(i);
      const V at[3] = {centre.x, centre.y, centre.z};
      const V most = (hn::Load(d, pairs_.best + i) - hn::Load(d, ball_ + i)) +
                     hn::Set(d, Rounding<float>::overlap) * hn::Load(d, pairs_.size + i);
      for (std::size_t k = 0; k < 3; ++k) {
        const V half = pairs_.half(static_cast<int>(k), i);
        append(bits_of(d, hn::Lt(half - at[k], most)), i, 2 * k);
        append(bits_of(d, hn::Lt(half + at[k], most)), i, 2 * k + 1);
      }
    }
  }
  HWY_INLINE void append(std::uint32_t bits, std::size_t i, std::size_t face) {
    for (; bits != 0; bits &= bits - 1) {
      items_[count_++] = item(i + static_cast<std::size_t>(std::countr_zero(bits)), face);
    }
  }

  /// Computes the extent of the hulls along the normals of these faces, four at a time.
  void evaluate_faces_of_box() {
    for (float(&column)[block_pairs] : extent_) {
      for (std::size_t i = 0; i < block_pairs; i += lanes) hn::Store(hn::Set(d, 1e30f), d, column + i);
    }
    const auto of_hull = [&](std::size_t k) HWY_ATTR {
      const Item item = items_[k];
      const RotationMatrix<float> r = pairs_.placed.rotation_of(item.pair);
      const float* const row = r.m[item.face / 2];
      const Vec3f direction{row[0], row[1], row[2]};
      return highest(*pairs_.hull[item.pair], (item.face & 1) != 0 ? direction : -direction);
    };
    for_each_greatest(count_, of_hull,
                      [&](std::size_t k, float most) { extent_[items_[k].face][items_[k].pair] = most; });
    for (std::size_t k = 0; k < count_; ++k) {
      ++pairs_.work.directions;
      pairs_.work.pass<float>(pairs_.hull[items_[k].pair]->vertex_count());
    }
  }

  /// Chooses the face of either shape with the least overlap.
  HWY_INLINE void choose_faces(std::size_t i) {
    V best = hn::Load(d, pairs_.best + i);
    Vector<D> direction = negate(d, rotate(d, pairs_.placed.rotation_lanes(d, i), load(d, normal_, i)));
    V* const along[3] = {&direction.x, &direction.y, &direction.z};
    const auto consider = [&](int k, V overlap, float sign) HWY_ATTR {
      const auto less = hn::Lt(overlap, best);
      best = hn::Min(overlap, best);
      for (int j = 0; j < 3; ++j) *along[j] = hn::IfThenElse(less, hn::Set(d, j == k ? sign : 0.0f), *along[j]);
    };
    for (int k = 0; k < 3; ++k) {
      consider(k, (pairs_.half(k, i) + hn::Load(d, extent_[2 * k] + i)) - pairs_.offset(k, i), 1.0f);
      consider(k, (pairs_.half(k, i) + hn::Load(d, extent_[2 * k + 1] + i)) + pairs_.offset(k, i), -1.0f);
    }
    hn::Store(best, d, pairs_.best + i);
    store(d, direction, pairs_.best_direction, i);
  }

  BoxHullPairs& pairs_;
  BoxHullBounds& bounds_;
  std::size_t count_ = 0;
  Item items_[6 * block_pairs];
  // Faces of hulls whose bounds are equal to the least within the errors.
  std::size_t other_count_ = 0;
  Item others_[block_pairs * max_faces];
  // The face of the hull that is evaluated in lanes, and its offset; the normal with the least overlap, in the axes of
  // the hull.
  alignas(64) std::uint32_t face_[block_pairs];
  alignas(64) float height_[block_pairs];
  alignas(64) Column3 normal_;
  alignas(64) float ball_[block_pairs];       // the radius of the ball inside the hull
  alignas(64) float extent_[6][block_pairs];  // of the hull beyond its origin, against the normal of each face
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
