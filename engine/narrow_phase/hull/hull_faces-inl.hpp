// First steps of the test of two hulls, for a block of pairs: the line between the centres, the cached axis, and the
// normals of all faces. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_HULL_FACES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_HULL_FACES_INL
#undef RINGFENCE_NARROW_PHASE_HULL_FACES_INL
#else
#define RINGFENCE_NARROW_PHASE_HULL_FACES_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "geometry/max_lanes-inl.hpp"
#include "narrow_phase/hull/hull_bounds-inl.hpp"
#include "narrow_phase/hull/hull_pairs-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

#if HWY_TARGET != HWY_SCALAR

/// Finds the face normal of least overlap for each pair of a block, and removes the pairs that a direction separates.
/// The steps are those of PolytopePair::separated_by_faces.
class HullFaces {
 public:
  HullFaces(HullPairs& pairs, HullBounds& bounds) : pairs_(pairs), bounds_(bounds) {}

  void run() {
    test_centre_axis();
    if (pairs_.input.memory != nullptr) test_cached_axes();
    if (pairs_.undecided.count == 0) return;
    // The lanes of decided pairs are computed too: leftovers on the stack could be slow to compute with.
    set_zero(vertex_);
    set_zero(normal_);
    set_zero(height_);
    set_zero(face_);
    place_vertices();
    bounds_.bound_faces();
    choose_least_bounds();
    evaluate_least_bounds();
    pairs_.remove_separated([&](std::size_t i) HWY_ATTR { return chosen_direction(i); });
    if (pairs_.undecided.count == 0) return;
    bounds_.add_second_points();
    try_other_faces();
    pairs_.remove_separated([&](std::size_t i) HWY_ATTR { return chosen_direction(i); });
    take_directions();
  }

 private:
  using D = HullPairs::D;
  using V = HullPairs::V;
  using Column3 = HullPairs::Column3;
  static constexpr D d{};
  static constexpr std::size_t lanes = HullPairs::lanes;
  static constexpr hn::RebindToUnsigned<D> ids{};
  static constexpr std::uint32_t no_face = ~0u;
  static constexpr std::size_t room_and_slack = 2048 + 4;  ///< list_faces() writes up to four entries more

  HWY_INLINE const geometry::Hull& hull(std::size_t side, std::size_t i) const { return *pairs_.hull[side][i]; }

  /// Removes the pairs that the line between the centres separates: most pairs that are apart.
  void test_centre_axis() {
    HullPairs& p = pairs_;
    for (std::size_t i = 0; i < p.count; i += 2) {
      float most[4];
      geometry::HWY_NAMESPACE::max_lanes_of_four(d, highest(hull(0, i), p.placed.axis(i)),
                                                 highest(hull(1, i), -p.placed.axis_in_second(i)),
                                                 highest(hull(0, i + 1), p.placed.axis(i + 1)),
                                                 highest(hull(1, i + 1), -p.placed.axis_in_second(i + 1)), most);
      p.axis_overlap[i] = (most[0] + most[1]) - p.placed.along_axis(i);
      p.axis_overlap[i + 1] = (most[2] + most[3]) - p.placed.along_axis(i + 1);
    }
    p.undecided.fill(p.count);
    for (std::size_t i = 0; i < p.count; ++i) {
      ++p.work.directions;
      count_vertices(i);
    }
    p.undecided.keep([&](std::size_t i) { return !(p.axis_overlap[i] < 0); });
  }

  void count_vertices(std::size_t i) {
    pairs_.work.pass<float>(hull(0, i).vertex_count());
    pairs_.work.pass<float>(hull(1, i).vertex_count());
  }

  /// Removes the pairs that the axis of an earlier frame still separates.
  void test_cached_axes() {
    HullPairs& p = pairs_;
    p.undecided.keep([&](std::size_t i) HWY_ATTR {
      const AxisMemory::Key key = p.key_of(i);
      AxisMemory::Slot& slot = (*p.input.memory)[key];
      if (slot.tag != key.tag) return true;
      const Body &a = p.input.bodies[p.pair[i].first], &b = p.input.bodies[p.pair[i].second];
      const geometry::ShapeRow &of_a = p.input.shapes.row(a.shape), &of_b = p.input.shapes.row(b.shape);
      const bool separated =
          remembered_axis_separates(HullSource(p.input.shapes, of_a), HullSource(p.input.shapes, of_b), p.placed.get(i),
                                    slot.axis, of_a.bounding_radius + of_b.bounding_radius, p.work);
      p.work.ended_early += separated;
      if (!separated) slot.tag = 0;
      return !separated;
    });
  }

  static HWY_INLINE std::size_t farthest(const geometry::Hull& of, Vec3f direction) {
    const float* const columns[3] = {of.x(), of.y(), of.z()};
    return farthest_of<float>(columns, of.vertex_count(), direction).index();
  }

  /// Finds the vertices deepest along the line between the centres.
  void place_vertices() {
    HullPairs& p = pairs_;
    for (std::size_t u = 0; u < p.undecided.count; ++u) {
      const std::size_t i = p.undecided.pair[u];
      put(hull(0, i).vertex(farthest(hull(0, i), p.placed.axis(i))), vertex_[0], i);
      put(hull(1, i).vertex(farthest(hull(1, i), -p.placed.axis_in_second(i))), vertex_[1], i);
      p.size[i] = hull(0, i).bounding_radius() + hull(1, i).bounding_radius();
    }
    for (std::size_t i = 0; i < p.count; i += lanes) {
      place_points(i, 0);
      store(d, in_first(i, p.centroids(1, i)), p.ball[0], i);
      store(d, in_second(i, p.centroids(0, i)), p.ball[1], i);
      const V inverse = hn::Set(d, 1.0f) / hn::Sqrt(hn::LoadU(d, p.placed.axis_squared() + i));
      hn::Store(hn::Load(d, p.axis_overlap + i) * inverse, d, p.best + i);
      const Vector<D> axis{hn::LoadU(d, p.placed.axis(0) + i), hn::LoadU(d, p.placed.axis(1) + i),
                           hn::LoadU(d, p.placed.axis(2) + i)};
      store(d, scale(d, axis, inverse), p.best_direction, i);
    }
  }

  HWY_INLINE Vector<D> in_first(std::size_t i, const Vector<D>& in_second) const {
    return add(d, rotate(d, pairs_.placed.rotation_lanes(d, i), in_second), pairs_.placed.offset_lanes(d, i));
  }
  HWY_INLINE Vector<D> in_second(std::size_t i, const Vector<D>& in_first) const {
    return unrotate(d, pairs_.placed.rotation_lanes(d, i), subtract(d, in_first, pairs_.placed.offset_lanes(d, i)));
  }
  /// Writes each hull's vertex in the axes of the other hull.
  HWY_INLINE void place_points(std::size_t i, std::size_t which) {
    store(d, in_first(i, load(d, vertex_[1], i)), pairs_.point[which][0], i);
    store(d, in_second(i, load(d, vertex_[0], i)), pairs_.point[which][1], i);
  }

  /// Chooses the face of each side with the least bound. It is often the best, and gives a good limit for all others.
  void choose_least_bounds() {
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::size_t i = pairs_.undecided.pair[u];
      for (std::size_t side = 0; side < 2; ++side) {
        const geometry::Hull& own = hull(side, i);
        const std::size_t face = bounds_.least_face(side, i);
        face_[side][i] = static_cast<std::uint32_t>(face);
        put(own.normal(face), normal_[side], i);
        height_[side][i] = own.offset()[face];
      }
      pairs_.work.pass<float>(hull(0, i).face_count() + hull(1, i).face_count());
    }
  }

  /// Computes the exact overlap along the normals of these faces. The vertices found there are the second points.
  void evaluate_least_bounds() {
    HullPairs& p = pairs_;
    alignas(64) Column3 toward[2];
    for (std::size_t i = 0; i < p.count; i += lanes) {
      const Rotation<D> r = p.placed.rotation_lanes(d, i);
      store(d, negate(d, rotate(d, r, load(d, normal_[1], i))), toward[0], i);
      store(d, negate(d, unrotate(d, r, load(d, normal_[0], i))), toward[1], i);
    }
    for (std::size_t u = 0; u < p.undecided.count; ++u) {
      const std::size_t i = p.undecided.pair[u];
      for (std::size_t side = 0; side < 2; ++side) {
        put(hull(side, i).vertex(farthest(hull(side, i), at(toward[side], i))), vertex_[side], i);
      }
      p.work.directions += 2;
      p.work.pass<float>(hull(0, i).vertex_count() + hull(1, i).vertex_count());
    }
    for (std::size_t i = 0; i < p.count; i += lanes) {
      place_points(i, 1);
      V best = hn::Load(d, p.best + i);
      auto choice = hn::Set(ids, no_face);
      for (std::size_t side = 0; side < 2; ++side) {
        const V value =
            hn::Load(d, height_[side] + i) - dot(d, load(d, normal_[side], i), load(d, p.point[1][side], i));
        const auto face = hn::Add(hn::Load(ids, face_[side] + i), hn::Set(ids, std::uint32_t(side * max_faces)));
        choice = hn::IfThenElse(hn::RebindMask(ids, hn::Lt(value, best)), face, choice);
        best = hn::Min(value, best);
      }
      hn::Store(best, d, p.best + i);
      hn::Store(choice, ids, choice_ + i);
    }
  }

  /// Evaluates the faces that the bounds do not exclude: one or two of a pair.
  void try_other_faces() {
    std::uint32_t items[2][room_and_slack];
    std::size_t count[2] = {0, 0};
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::size_t i = pairs_.undecided.pair[u];
      if (std::max(count[0], count[1]) + max_faces + 4 > room_and_slack) evaluate_faces(items, count);
      for (std::size_t side = 0; side < 2; ++side) {
        count[side] = bounds_.list_faces(side, i, face_[side][i], items[side], count[side]);
      }
      pairs_.work.pass<float>(hull(0, i).face_count() + hull(1, i).face_count());
    }
    evaluate_faces(items, count);
  }

  void evaluate_faces(const std::uint32_t (&items)[2][room_and_slack], std::size_t (&count)[2]) {
    for (std::size_t k = 0; k < count[0]; ++k) {
      const std::size_t i = items[0][k] >> 16, face = items[0][k] & 0xffff;
      const Vec3f normal = hull(0, i).normal(face);
      const Vec3f direction = -rotate_inverse(pairs_.placed.rotation_of(i), normal);
      consider(i, face,
               (hull(0, i).offset()[face] + pairs_.support(1, i, direction)) - dot(normal, pairs_.placed.offset_of(i)));
      count_face(i, 1);
    }
    for (std::size_t k = 0; k < count[1]; ++k) {
      const std::size_t i = items[1][k] >> 16, face = items[1][k] & 0xffff;
      const Vec3f direction = -rotate(pairs_.placed.rotation_of(i), hull(1, i).normal(face));
      consider(
          i, max_faces + face,
          (hull(1, i).offset()[face] + pairs_.support(0, i, direction)) - dot(direction, pairs_.placed.offset_of(i)));
      count_face(i, 0);
    }
    count[0] = count[1] = 0;
  }
  /// Without a branch on which face is better: the compiler makes one of a conditional expression here.
  HWY_INLINE void consider(std::size_t i, std::size_t face, float value) {
    const std::uint32_t less = std::uint32_t{0} - std::uint32_t{value < pairs_.best[i]};
    choice_[i] ^= (choice_[i] ^ static_cast<std::uint32_t>(face)) & less;
    pairs_.best[i] = std::min(value, pairs_.best[i]);
  }
  void count_face(std::size_t i, std::size_t other) {
    ++pairs_.work.directions;
    pairs_.work.pass<float>(hull(other, i).vertex_count());
  }

  /// The normal of the face of least overlap, from the first hull to the second.
  Vec3f chosen_direction(std::size_t i) const {
    if (choice_[i] == no_face) return at(pairs_.best_direction, i);
    if (choice_[i] < max_faces) return hull(0, i).normal(choice_[i]);
    return -rotate(pairs_.placed.rotation_of(i), hull(1, i).normal(choice_[i] - max_faces));
  }
  /// The same for all undecided pairs, without branches on the choice, which would be unpredictable.
  void take_directions() {
    HullPairs& p = pairs_;
    for (std::size_t u = 0; u < p.undecided.count; ++u) {
      const std::size_t i = p.undecided.pair[u];
      const std::size_t side = choice_[i] >= max_faces, face = choice_[i] == no_face ? 0 : choice_[i] % max_faces;
      put(hull(side, i).normal(face), normal_[0], i);
    }
    for (std::size_t i = 0; i < p.count; i += lanes) {
      const Vector<D> normal = load(d, normal_[0], i),
                      turned = negate(d, rotate(d, p.placed.rotation_lanes(d, i), normal));
      const auto choice = hn::Load(ids, choice_ + i);
      const auto of_first = hn::RebindMask(d, hn::Lt(choice, hn::Set(ids, std::uint32_t{max_faces})));
      const auto none = hn::RebindMask(d, hn::Eq(choice, hn::Set(ids, no_face)));
      store(d, choose(d, none, load(d, p.best_direction, i), choose(d, of_first, normal, turned)), p.best_direction, i);
    }
  }

  HullPairs& pairs_;
  HullBounds& bounds_;
  // The deepest vertices of each hull along the last direction, in its own axes; the face of least bound, its normal
  // and its offset.
  alignas(64) Column3 vertex_[2], normal_[2];
  alignas(64) float height_[2][block_pairs];
  alignas(64) std::uint32_t face_[2][block_pairs];
  // The face of least overlap: of the first hull, or of the second counted from max_faces on.
  alignas(64) std::uint32_t choice_[block_pairs];
};

#endif

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
