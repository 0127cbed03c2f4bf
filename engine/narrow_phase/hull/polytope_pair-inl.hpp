// Tests two convex polytopes: whether they overlap, and the least translation that separates them. Included once for
// each Highway target.
//
// The overlap along a direction n is support of a along n + support of b along -n. The depth is the least overlap over
// all directions. It is attained at the normal of a face of the Minkowski difference, which is the normal of a face of
// a, of a face of b, or a direction across an edge of each whose arcs of normals cross (the Gauss map; Gregorius, "The
// Separating Axis Test", 2013). All of them are candidates. To exclude most of them quickly, a ball inside one shape
// and some of its vertices give a lower bound of the overlap for the faces and edges of the other shape. Only few face
// normals and edges can then be better than the best direction found so far. Any direction with negative overlap
// separates the shapes; the direction between the centres, which separates most pairs that are apart, has been tried
// before.
//
// Termination: every stage goes through a list once. Nearly parallel edges and nearly touching arcs are evaluated by
// their exact overlap, so that rounding cannot make the depth less than the overlap along the reported normal.

#if defined(RINGFENCE_NARROW_PHASE_POLYTOPE_PAIR_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_POLYTOPE_PAIR_INL
#undef RINGFENCE_NARROW_PHASE_POLYTOPE_PAIR_INL
#else
#define RINGFENCE_NARROW_PHASE_POLYTOPE_PAIR_INL
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "narrow_phase/hull/hull_edges-inl.hpp"
#include "narrow_phase/hull/placement-inl.hpp"
#include "narrow_phase/hull/polytope_contact-inl.hpp"
#include "narrow_phase/hull/support_feature-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Lower bounds of the overlap along the face normals of one shape. Two are from points inside the other shape (its
/// deepest vertex along some direction), one from the ball inside the other shape.
template <class T>
struct FaceBounds {
  static constexpr std::size_t words = max_faces / 64;
  using Set = std::uint64_t[words];  ///< a set of faces

  alignas(64) T ball_centre[max_faces];  ///< distance from the face's plane to the centre of the ball, positive inside
  alignas(64) T point[2][max_faces];
  alignas(64) T bound[max_faces];  ///< the better of the bounds of the ball and the first point
};

template <class T>
class PolytopePair {
 public:
  /// Results along the placement's axis, which does not separate the two: the overlap (times the length of the axis),
  /// and the deepest vertices.
  struct Start {
    T value;
    std::size_t vertex_of_a, vertex_of_b;
  };
  HWY_INLINE PolytopePair(const Polytope& a, const Polytope& b, const Placement<T>& placement, const Start& start,
                          WorkCounts& work)
      : a_(a), b_(b), rotation_(placement.second_to_first), offset_(placement.offset), start_(start), work_(work) {
    const T inverse = T(1) / std::sqrt(placement.axis_squared);
    best_ = start.value * inverse;
    direction_ = placement.axis * inverse;
    centre_of_b_ = rotate(rotation_, point_of<T>(b.centre)) + offset_;
  }

  /// Returns whether the polytopes overlap or touch; if so, writes the overlap to `out`.
  bool test(Overlap<T>& out) {
    if (separated_by_faces()) return false;
    const T after_faces = best_;
    const Point<T> direction_after_faces = direction_;
    if (separated_by_edges(false)) return false;
    out = contact_along(direction_);
    if (out.depth > best_ + Rounding<T>::sure * (best_ + size())) {
      // An edge pair that was accepted was not a face of the difference. This was never observed, but if it happens
      // each edge pair is evaluated by its exact overlap.
      best_ = after_faces;
      direction_ = direction_after_faces;
      if (separated_by_edges(true)) return false;
      out = contact_along(direction_);
    }
    return true;
  }

  /// After a test that found the polytopes apart: a unit direction that separates them, in the axes of a.
  Point<T> direction() const { return direction_; }

 private:
  static constexpr Columns16<T> d{};
  using Lanes = hn::Vec<Columns16<T>>;
  using Bounds = FaceBounds<T>;

  Overlap<T> contact_along(Point<T> direction) const {
    return PolytopeContact<T>(a_, b_, rotation_, offset_).along(direction);
  }

  HWY_INLINE T size() const { return T(a_.outer_radius) + T(b_.outer_radius); }

  /// The limit for the bound of a candidate to which the radius `inner_radius` of a ball is still to be added.
  HWY_INLINE T limit(float inner_radius) const { return (best_ - T(inner_radius)) + Rounding<T>::overlap * size(); }

  HWY_INLINE T overlap_along(Point<T> direction) const {
    return (support<T>(a_, direction) + support<T>(b_, -rotate_inverse(rotation_, direction))) -
           dot(direction, offset_);
  }

  /// Records the overlap `value` along a unit direction; returns whether the direction separates the polytopes.
  HWY_INLINE bool separates(Point<T> direction, T value) {
    if (value < best_) {
      best_ = value;
      direction_ = direction;
    }
    return value < T(0);
  }

  /// The deepest vertex of one shape along a direction from a to b, in the axes of the other shape.
  HWY_INLINE Point<T> deepest_of_a(Point<T> direction) const {
    return rotate_inverse(rotation_, vertex_of<T>(a_, farthest_vertex<T>(a_, direction)) - offset_);
  }
  HWY_INLINE Point<T> deepest_of_b(Point<T> direction_in_b) const {
    return vertex_of_b(farthest_vertex<T>(b_, -direction_in_b));
  }

  /// Computes the first bounds of all faces; returns the face with the least.
  static std::size_t bound_faces(const Polytope& own, Point<T> centre, float radius, Point<T> point, Bounds& out) {
    const auto c = spread_out(d, centre), p = spread_out(d, point);
    const auto r = hn::Set(d, T(radius));
    for (std::size_t i = 0; i < own.faces; i += hn::Lanes(d)) {
      const auto normal = read(d, own.normal[0] + i, own.normal[1] + i, own.normal[2] + i);
      const auto offset = read(d, own.offset + i);
      const auto of_centre = offset - dot_of(d, normal, c), of_point = offset - dot_of(d, normal, p);
      hn::Store(of_centre, d, out.ball_centre + i);
      hn::Store(of_point, d, out.point[0] + i);
      hn::Store(hn::Max(of_centre + r, of_point), d, out.bound + i);
    }
    return least_of(out.bound, own.faces);
  }

  /// Adds the bounds by a second point; writes the set of faces that can still be the best.
  void add_point(const Polytope& own, Point<T> point, Bounds& bounds, typename Bounds::Set candidates) const {
    T* const out = bounds.point[1];
    const auto p = spread_out(d, point);
    const auto most = hn::Set(d, limit(0));
    collect(d, own.faces, candidates, [&](std::size_t i) HWY_ATTR {
      const auto normal = read(d, own.normal[0] + i, own.normal[1] + i, own.normal[2] + i);
      const auto depth = read(d, own.offset + i) - dot_of(d, normal, p);
      hn::Store(depth, d, out + i);
      return hn::Lt(hn::Max(depth, hn::Load(d, bounds.bound + i)), most);
    });
  }

  bool separated_by_faces() {
    const Point<T> centre_of_a_in_b = rotate_inverse(rotation_, point_of<T>(a_.centre) - offset_);
    const Point<T> in_a = vertex_of_b(start_.vertex_of_b);
    const Point<T> in_b = rotate_inverse(rotation_, vertex_of_a(start_.vertex_of_a) - offset_);
    const std::size_t of_a = bound_faces(a_, centre_of_b_, b_.inner_radius, in_a, bounds_of_a_);
    const std::size_t of_b = bound_faces(b_, centre_of_a_in_b, a_.inner_radius, in_b, bounds_of_b_);
    work_.pass<T>(a_.faces + b_.faces);
    // The face with the least bound is often the best one, and gives a good limit for all others.
    const Point<T> normal_of_a = normal_of<T>(a_, of_a), normal_of_b = normal_of<T>(b_, of_b);
    const Point<T> deepest_b = deepest_of_b(rotate_inverse(rotation_, normal_of_a));
    const Point<T> direction_of_b = -rotate(rotation_, normal_of_b);
    const Point<T> deepest_a = deepest_of_a(direction_of_b);
    work_.directions += 2;
    work_.pass<T>(a_.vertices + b_.vertices);
    FaceChoice choice{best_};
    choice.consider(of_a, T(a_.offset[of_a]) - dot(normal_of_a, deepest_b));
    choice.consider(max_faces + of_b, T(b_.offset[of_b]) - dot(normal_of_b, deepest_a));
    best_ = choice.least;
    if (best_ < T(0)) {
      take_direction(choice);
      return true;
    }

    typename Bounds::Set candidates_of_a, candidates_of_b;
    add_point(a_, deepest_b, bounds_of_a_, candidates_of_a);
    add_point(b_, deepest_a, bounds_of_b_, candidates_of_b);
    work_.pass<T>(a_.faces + b_.faces);
    candidates_of_a[of_a / 64] &= ~(std::uint64_t{1} << of_a % 64);
    candidates_of_b[of_b / 64] &= ~(std::uint64_t{1} << of_b % 64);
    for_each_in(candidates_of_a, a_.faces, [&](std::size_t face) HWY_ATTR {
      const Point<T> normal = normal_of<T>(a_, face);
      choice.consider(face,
                      (T(a_.offset[face]) + support<T>(b_, -rotate_inverse(rotation_, normal))) - dot(normal, offset_));
      ++work_.directions;
      work_.pass<T>(b_.vertices);
    });
    for_each_in(candidates_of_b, b_.faces, [&](std::size_t face) HWY_ATTR {
      const Point<T> direction = -rotate(rotation_, normal_of<T>(b_, face));
      choice.consider(max_faces + face, (T(b_.offset[face]) + support<T>(a_, direction)) - dot(direction, offset_));
      ++work_.directions;
      work_.pass<T>(a_.vertices);
    });
    best_ = choice.least;
    take_direction(choice);
    return best_ < T(0);
  }

  /// The face of least overlap: a face of a, or a face of b counted from max_faces on. Chosen without a branch.
  struct FaceChoice {
    static constexpr std::size_t none = ~std::size_t{0};
    T least;
    std::size_t face = none;

    HWY_INLINE void consider(std::size_t of, T value) {
      face = value < least ? of : face;
      least = std::min(value, least);
    }
  };

  HWY_INLINE void take_direction(const FaceChoice& choice) {
    if (choice.face < max_faces) {
      direction_ = normal_of<T>(a_, choice.face);
    } else if (choice.face != FaceChoice::none) {
      direction_ = -rotate(rotation_, normal_of<T>(b_, choice.face - max_faces));
    }
  }

  /// Lists the edges that neither the points nor the ball exclude, ascending. Along the arc between the normals of an
  /// edge's two faces, the overlap is at least the depth of any point inside the other shape. On the arc that depth is
  /// never less than at the ends, unless it is negative there. So a point that is too deep for both faces excludes the
  /// edge.
  std::size_t list_edges(const Polytope& own, float other_radius, const Bounds& bounds, std::uint16_t* out) const {
    alignas(64) std::uint8_t too_far[max_faces];  // for each face, one bit for each point and one for the ball
    const hn::RebindToSigned<Columns16<T>> ints;
    const auto of_point = hn::Set(d, limit(0)), of_ball = hn::Set(d, std::max(limit(other_radius), T(0)));
    const auto bit = [&](const T* distance, Lanes least, int k)
                         HWY_ATTR { return bit_where(d, hn::Ge(hn::Load(d, distance), least), k); };
    for (std::size_t i = 0; i < own.faces; i += hn::Lanes(d)) {
      auto mask = bit(bounds.ball_centre + i, of_ball, 0);
      mask = hn::Or(mask, bit(bounds.point[0] + i, of_point, 1));
      mask = hn::Or(mask, bit(bounds.point[1] + i, of_point, 2));
      store_bytes(ints, mask, too_far + i);
    }
    return list_edges_where(own, too_far, NoCommonBit(), std::uint16_t{0}, out);
  }

  /// Columns of the candidate edges of b, in the axes of a: left and right normal, a point, the direction.
  struct KeptEdges {
    alignas(64) T value[12 * max_edges];
    std::uint16_t index[max_edges + edge_list_slack];
    std::size_t count = 0, stride = 0;

    T* column(std::size_t c) { return value + c * stride; }
  };

  static HWY_INLINE void put(T* to, std::size_t stride, const Point<T>& p) {
    to[0] = p.x;
    to[stride] = p.y;
    to[2 * stride] = p.z;
  }

  void gather_edges(KeptEdges& kept) const {
    kept.stride = geometry::padded(kept.count);
    for (std::size_t i = 0; i < kept.count; ++i) {
      const geometry::HullEdge& edge = b_.edge[kept.index[i]];
      put(kept.column(0) + i, kept.stride, normal_of<T>(b_, edge.left));
      put(kept.column(3) + i, kept.stride, normal_of<T>(b_, edge.right));
      put(kept.column(6) + i, kept.stride, vertex_of<T>(b_, edge.from));
      put(kept.column(9) + i, kept.stride, along_edge<T>(b_, kept.index[i]));
    }
    for (std::size_t i = 0; i < kept.count; i += hn::Lanes(d)) {
      // Lanes past the end are computed but not used. They are zeroed, since leftovers on the stack could be slow to
      // compute with.
      const auto real = hn::FirstN(d, kept.count - i);
      for (std::size_t c = 0; c < 12; c += 3) {
        const auto q = load(kept, c, i);
        auto p = rotated(d, rotation_,
                         Points<Columns16<T>>{hn::IfThenElseZero(real, q.x), hn::IfThenElseZero(real, q.y),
                                              hn::IfThenElseZero(real, q.z)});
        if (c == 6) {
          const auto o = spread_out(d, offset_);
          p = {p.x + o.x, p.y + o.y, p.z + o.z};
        }
        hn::Store(p.x, d, kept.column(c) + i);
        hn::Store(p.y, d, kept.column(c + 1) + i);
        hn::Store(p.z, d, kept.column(c + 2) + i);
      }
    }
  }

  static HWY_INLINE Points<Columns16<T>> load(KeptEdges& kept, std::size_t c, std::size_t i) {
    return {hn::Load(d, kept.column(c) + i), hn::Load(d, kept.column(c + 1) + i), hn::Load(d, kept.column(c + 2) + i)};
  }
  static HWY_INLINE Point<T> at(KeptEdges& kept, std::size_t c, std::size_t i) {
    return {kept.column(c)[i], kept.column(c + 1)[i], kept.column(c + 2)[i]};
  }

  bool separated_by_edges(bool recheck_all) {
    std::uint16_t of_a[max_edges + edge_list_slack];
    const std::size_t count = list_edges(a_, b_.inner_radius, bounds_of_a_, of_a);
    if (count == 0) return false;
    KeptEdges of_b;
    of_b.count = list_edges(b_, a_.inner_radius, bounds_of_b_, of_b.index);
    if (of_b.count == 0) return false;
    gather_edges(of_b);
    for (std::size_t i = 0; i < count; ++i) {
      work_.pass<T>(of_b.count);
      if (edge_separates(of_a[i], of_b, recheck_all)) return true;
    }
    return false;
  }

  /// Tests one edge of a against all candidate edges of b.
  bool edge_separates(std::size_t index, KeptEdges& of_b, bool recheck_all) {
    const geometry::HullEdge& edge = a_.edge[index];
    const Point<T> left = normal_of<T>(a_, edge.left), right = normal_of<T>(a_, edge.right);
    const Point<T> from = vertex_of<T>(a_, edge.from), along = along_edge<T>(a_, index);
    const auto left_a = spread_out(d, left), right_a = spread_out(d, right);
    const auto from_a = spread_out(d, from), along_a = spread_out(d, along);
    const auto miss = hn::Set(d, -Rounding<T>::miss);
    // One limit for the whole row, so that the set of evaluated edges does not depend on the vector width.
    const T best = best_;
    const auto best_squared = hn::Set(d, best * best);
    std::uint16_t chosen[max_edges];
    std::size_t count = 0;
    for (std::size_t i = 0; i < of_b.count; i += hn::Lanes(d)) {
      const auto along_b = load(of_b, 9, i);
      const auto p = dot_of(d, load(of_b, 0, i), along_a), q = dot_of(d, load(of_b, 3, i), along_a);
      const auto r = dot_of(d, left_a, along_b), s = dot_of(d, right_a, along_b);
      const auto forward = hn::Min(hn::Min(hn::Neg(p), q), hn::Min(hn::Neg(r), s));
      const auto backward = hn::Min(hn::Min(p, hn::Neg(q)), hn::Min(r, hn::Neg(s)));
      const auto crossing = hn::Gt(hn::Max(forward, backward), miss);
      if (hn::AllFalse(d, crossing)) continue;
      const Points<Columns16<T>> across{along_b.y * along_a.z - along_b.z * along_a.y,
                                        along_b.z * along_a.x - along_b.x * along_a.z,
                                        along_b.x * along_a.y - along_b.y * along_a.x};
      const auto sine_squared = dot_of(d, across, across);
      const auto height = dot_of(d, across, minus(d, from_a, load(of_b, 6, i)));
      const auto value = hn::IfThenElse(hn::Ge(forward, backward), height, hn::Neg(height));
      const auto better = hn::Lt(value * hn::Abs(value), best_squared * sine_squared);
      const auto has_direction = hn::Gt(sine_squared, hn::Set(d, Rounding<T>::parallel_sine_squared));
      std::uint32_t bits = bits_of(d, hn::And(hn::And(crossing, better), has_direction)) & first_bits(of_b.count - i);
      for (; bits != 0; bits &= bits - 1) {
        chosen[count++] = static_cast<std::uint16_t>(i + static_cast<std::size_t>(__builtin_ctz(bits)));
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (pair_separates(left, right, from, along, of_b, chosen[i], recheck_all)) return true;
    }
    return false;
  }

  bool pair_separates(Point<T> left, Point<T> right, Point<T> from, Point<T> along, KeptEdges& of_b, std::size_t other,
                      bool recheck_all) {
    ++work_.directions;
    const Point<T> along_b = at(of_b, 9, other);
    const T p = dot(at(of_b, 0, other), along), q = dot(at(of_b, 3, other), along);
    const T r = dot(left, along_b), s = dot(right, along_b);
    const T forward = std::min(std::min(-p, q), std::min(-r, s)), backward = std::min(std::min(p, -q), std::min(r, -s));
    Point<T> across = cross(along_b, along);
    if (forward < backward) across = -across;
    const T sine_squared = dot(across, across);
    const Point<T> direction = across * (T(1) / std::sqrt(sine_squared));
    const T value = dot(direction, from - at(of_b, 6, other));
    if (!(value < best_)) return false;
    const bool sure = std::max(forward, backward) > Rounding<T>::sure && sine_squared > Rounding<T>::sure_sine_squared;
    if (sure && value >= T(0) && !recheck_all) return separates(direction, value);
    return separates(direction, overlap_along(direction));
  }

  HWY_INLINE Point<T> vertex_of_a(std::size_t i) const { return vertex_of<T>(a_, i); }
  HWY_INLINE Point<T> vertex_of_b(std::size_t i) const { return rotate(rotation_, vertex_of<T>(b_, i)) + offset_; }

  const Polytope& a_;
  const Polytope& b_;
  const RotationMatrix<T> rotation_;
  const Point<T> offset_;
  Point<T> centre_of_b_;
  const Start start_;
  WorkCounts& work_;
  Bounds bounds_of_a_, bounds_of_b_;  // bounds of the faces of each shape, by points of the other
  T best_ = 0;                        // the least overlap found
  Point<T> direction_{};              // its direction, from a to b
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
