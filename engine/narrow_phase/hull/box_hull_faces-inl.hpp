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
#include <cstddef>
#include <cstdint>

#include "geometry/max_lanes-inl.hpp"
#include "narrow_phase/hull/box_hull_pairs-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Finds the face normal of least overlap for each pair of a block, and removes the pairs that a direction separates.
///
/// The support of a box needs no search, so the exact overlap along every face normal of the hull takes one pass. For
/// the six faces of the box, the ball inside the hull gives a lower bound; the exact overlap is computed for the one or
/// two that this bound does not exclude.
class BoxHullFaces {
 public:
  explicit BoxHullFaces(BoxHullPairs& pairs) : pairs_(pairs) {}

  void run() {
    test_centre_axis();
    if (pairs_.undecided.count == 0) return;
    // The lanes of decided pairs are computed too: leftovers on the stack could be slow to compute with.
    set_zero(pairs_.best);
    set_zero(pairs_.size);
    set_zero(normal_);
    set_zero(ball_);
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

  /// Removes the pairs that the line between the centres separates: most pairs that are apart.
  void test_centre_axis() {
    BoxHullPairs& p = pairs_;
    alignas(64) float overlap[block_pairs];
    const auto of_hull = [&](std::size_t i) HWY_ATTR { return highest(*p.hull[i], -p.placed.axis_in_second(i)); };
    for (std::size_t i = 0; i < p.count; i += 4) {
      geometry::HWY_NAMESPACE::max_lanes_of_four(d, of_hull(i), of_hull(i + 1), of_hull(i + 2), of_hull(i + 3),
                                                 overlap + i);
    }
    for (std::size_t i = 0; i < p.count; i += lanes) {
      V rest = hn::Neg(hn::LoadU(d, p.placed.along_axis() + i));
      for (int k = 0; k < 3; ++k) rest = rest + hn::Abs(hn::LoadU(d, p.placed.axis(k) + i)) * p.half(k, i);
      hn::Store(rest + hn::Load(d, overlap + i), d, overlap + i);
    }
    p.undecided.count = p.count;
    for (std::size_t i = 0; i < p.count; ++i) {
      p.undecided.pair[i] = static_cast<std::uint32_t>(i);
      ++p.work.directions;
      p.work.pass<float>(p.hull[i]->vertex_count());
    }
    p.undecided.keep([&](std::size_t i) { return overlap[i] >= 0; });
  }

  /// Rotates vectors from the axes of one hull to those of its box. Each lane is one face of the hull.
  struct RotationLanes {
    V m[3][3];
    HWY_INLINE V operator()(int k, V x, V y, V z) const { return m[k][0] * x + m[k][1] * y + m[k][2] * z; }
  };
  HWY_INLINE V spread(const float* column, std::size_t i) const { return hn::Set(d, column[i]); }
  HWY_INLINE RotationLanes rotation_from(std::size_t i) const {
    RotationLanes t;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) t.m[k][j] = spread(pairs_.placed.second_to_first(k, j), i);
    }
    return t;
  }

  /// Finds the normal of the hull's faces with the least overlap. Sets the bits of the signs of all normals.
  void try_faces_of_hull() {
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::size_t i = pairs_.undecided.pair[u];
      const geometry::Hull& hull = *pairs_.hull[i];
      find_least(i, hull, overlaps_[u]);
      pairs_.size[i] = pairs_.box(i).bounding_radius + hull.bounding_radius();
      ball_[i] = hull.inner_radius();
      pairs_.work.directions += hull.face_count();
      pairs_.work.pass<float>(hull.face_count());
    }
    for_each_least(overlaps_, pairs_.undecided.count, [&](std::size_t u, float overlap, std::size_t face) HWY_ATTR {
      const std::size_t i = pairs_.undecided.pair[u];
      pairs_.best[i] = overlap;
      put(pairs_.hull[i]->normal(face), normal_, i);
    });
  }

  HWY_INLINE void find_least(std::size_t i, const geometry::Hull& hull, LeastLanes& out) {
    const PlacementColumns& placed = pairs_.placed;
    const RotationLanes to_box = rotation_from(i);
    const V h[3] = {spread(placed.first_size(0), i), spread(placed.first_size(1), i), spread(placed.first_size(2), i)};
    const V t[3] = {spread(placed.offset(0), i), spread(placed.offset(1), i), spread(placed.offset(2), i)};
    Least<float> least(hn::Set(d, 1e30f));
    const auto try_vector = [&](FaceBytes& bytes, int vector, std::size_t f) HWY_ATTR {
      const V x = hn::Load(d, hull.normal_x() + f), y = hn::Load(d, hull.normal_y() + f),
              z = hn::Load(d, hull.normal_z() + f);
      const V n[3] = {to_box(0, x, y, z), to_box(1, x, y, z), to_box(2, x, y, z)};
      for (int k = 0; k < 3; ++k) bytes.set(vector, BoxHullPairs::sign_bit + k, hn::Lt(n[k], hn::Zero(d)));
      least.add(((hn::Abs(n[0]) * h[0] + hn::Abs(n[1]) * h[1]) + hn::Abs(n[2]) * h[2]) +
                    (hn::Load(d, hull.offset() + f) + ((n[0] * t[0] + n[1] * t[1]) + n[2] * t[2])),
                f);
    };
    std::uint8_t* const marks = pairs_.face_bytes[i];
    for_face_bytes(hull.face_count(), try_vector,
                   [&](const FaceBytes& bytes, std::size_t f) HWY_ATTR { bytes.store(marks + f); });
    least.store(out.least, out.at);
  }

  /// A face of a box that can have less overlap than all faces of the hull.
  struct Item {
    std::uint32_t pair;
    std::uint32_t face;  ///< twice the axis; one more on the negative side
  };

  void list_faces_of_box() {
    std::uint32_t undecided = 0;
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) undecided |= 1u << pairs_.undecided.pair[u];
    for (std::size_t i = 0; i < pairs_.count; i += lanes) {
      const Vector<D> of_hull{hn::LoadU(d, pairs_.placed.second_size(0) + i),
                              hn::LoadU(d, pairs_.placed.second_size(1) + i),
                              hn::LoadU(d, pairs_.placed.second_size(2) + i)};
      const Vector<D> centre =
          add(d, rotate(d, pairs_.placed.rotation_lanes(d, i), of_hull), pairs_.placed.offset_lanes(d, i));
      const V at[3] = {centre.x, centre.y, centre.z};
      const V most = (hn::Load(d, pairs_.best + i) - hn::Load(d, ball_ + i)) +
                     hn::Set(d, Rounding<float>::overlap) * hn::Load(d, pairs_.size + i);
      for (std::uint32_t k = 0; k < 3; ++k) {
        const V half = pairs_.half(static_cast<int>(k), i);
        append(bits_of(d, hn::Lt(half - at[k], most)) & undecided >> i, i, 2 * k);
        append(bits_of(d, hn::Lt(half + at[k], most)) & undecided >> i, i, 2 * k + 1);
      }
    }
  }
  HWY_INLINE void append(std::uint32_t bits, std::size_t i, std::uint32_t face) {
    for (; bits != 0; bits &= bits - 1) {
      items_[count_++] = {static_cast<std::uint32_t>(i) + static_cast<std::uint32_t>(std::countr_zero(bits)), face};
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
  LeastLanes overlaps_[block_pairs];
  std::size_t count_ = 0;
  Item items_[6 * block_pairs];
  alignas(64) Column3 normal_;                // of the hull's face with the least overlap, in the axes of the hull
  alignas(64) float ball_[block_pairs];       // the radius of the ball inside the hull
  alignas(64) float extent_[6][block_pairs];  // of the hull beyond its origin, against the normal of each face
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
