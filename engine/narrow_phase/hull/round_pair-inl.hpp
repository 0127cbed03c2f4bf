// Tests one sphere or capsule against a convex polytope: first its core (a point or a segment), then its radius.
// Included once for each Highway target.
//
// Where the core is outside, the contact is at the nearest points: on a face, if the end of the core that is nearest to
// its plane lies over it, else on an edge. Where the core reaches inside, the least translation is along the normal of
// a face or, for a segment, across an edge and the segment. All faces and edges are tried, one vector at a time, so the
// test always ends and does not depend on a start value. The farthest plane decides most pairs that are apart.
//
// In float, rounding can make the direction between two near points too imprecise, or select the wrong one of two
// almost equal distances. So the direction is verified: where it does not separate the shapes as it should, the result
// is `undecided`, and the caller repeats the test in double.

#if defined(RINGFENCE_NARROW_PHASE_ROUND_PAIR_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_ROUND_PAIR_INL
#undef RINGFENCE_NARROW_PHASE_ROUND_PAIR_INL
#else
#define RINGFENCE_NARROW_PHASE_ROUND_PAIR_INL
#endif

#include <algorithm>
#include <cmath>

#include "narrow_phase/hull/polytope_pair-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

enum class Decision { apart, contact, undecided };

/// The core in the axes of the polytope. For a sphere the three points are equal.
template <class T>
struct RoundPlacement {
  RotationMatrix<T> to_world;  ///< from the axes of the polytope to the world's
  Point<T> offset;             ///< from the round body's position to the polytope's, in world axes
  Point<T> centre, from, to;

  HWY_INLINE RoundPlacement(const Pose& round, const Pose& body, float half_height)
      : to_world(rotation_matrix_of<T>(body.orientation)), offset(difference_of<T>(body.position, round.position)) {
    centre = from = to = -rotate_inverse(to_world, offset);
    if (half_height > 0) {
      const RotationMatrix<T> own = rotation_matrix_of<T>(round.orientation);
      const Point<T> half = rotate_inverse(to_world, Point<T>{own.m[0][2], own.m[1][2], own.m[2][2]}) * T(half_height);
      from = centre - half;
      to = centre + half;
    }
  }
};

/// `segment` is false if the core is a point.
template <class T, bool segment>
class RoundPair {
 public:
  /// The core is the segment from `from` to `to`, in the axes of the polytope; both are equal for a sphere.
  HWY_INLINE RoundPair(const Polytope& polytope, Point<T> from, Point<T> to, T radius)
      : p_(polytope), from_(from), to_(to), radius_(radius) {
    const Point<T> axis = to - from;
    length_ = segment ? std::sqrt(dot(axis, axis)) : T(0);
    axis_ = length_ > T(0) ? axis * (T(1) / length_) : Point<T>{};
  }

  /// If there is a contact, writes it to `out`: the normal points from the core to the polytope, everything in the
  /// polytope's axes.
  HWY_INLINE Decision test(Overlap<T>& out) {
    farthest_face();
    work_.directions += p_.faces;
    work_.pass<T>(p_.faces);
    if (separation_ > radius_) return Decision::apart;
    T inside = separation_;  // the greatest distance, over all directions, by which a plane separates core and polytope
    const T in_doubt = doubtful * size();
    // Where the plane of a face separates the two, the core is outside whatever the crossings with edges are.
    if (segment && separation_ < in_doubt) {
      inside = std::max(inside, farthest_crossing());
      work_.directions += p_.edges;
      work_.pass<T>(p_.edges);
      if (inside > radius_) return Decision::apart;
    }
    if (sizeof(T) == 4 && std::abs(inside) < in_doubt) return Decision::undecided;
    if (inside <= T(0)) {
      out = from_inside(inside);
      return Decision::contact;
    }
    if (!over_a_face()) {
      nearest_edge();
      work_.pass<T>(p_.edges);
    }
    if (!(distance_ > rounding())) {
      out = from_inside(inside);
      return Decision::contact;
    }
    // From the core's nearest point towards the polytope's: the two surfaces are at the distances `radius` and
    // `distance`.
    const Point<T> normal = gap_ * (T(1) / std::sqrt(dot(gap_, gap_)));
    const T depth = radius_ - distance_;
    // The computed points are never nearer than the true nearest points, so the depth is never too large. It is not too
    // small either if the normal separates the shapes as it should.
    const T overlap = radius_ - apart_along(-normal);
    if (sizeof(T) == 4) {
      if (overlap < T(0)) return Decision::apart;
      if (overlap > depth + sure() || depth < T(0)) return Decision::undecided;
    } else if (overlap > depth + sure() && distance_ - inside <= sure()) {
      // At a distance as small as the rounding of the hull, the direction to the nearest point is arbitrary. The plane
      // of greatest distance is equally good.
      out = from_inside(inside);
      return Decision::contact;
    }
    if (depth < T(0)) return Decision::apart;
    out = {depth, normal, nearest_ + normal * ((radius_ + distance_) * T(0.5))};
    return Decision::contact;
  }

  const WorkCounts& work() const { return work_; }

  /// Parts of the sizes: the distance from the surface within which rounding decides whether a core is inside, and the
  /// rounding error of a length.
  static constexpr T doubtful = T(1e-5);
  static constexpr T rounding_part = sizeof(T) == 4 ? T(1e-6) : T(1e-12);

  /// The positions of the nearest points along core and edge (Ericson 2005, section 5.1.9, with unit directions).
  struct Parts {
    hn::Vec<Columns16<T>> of_core, of_edge;
  };
  static HWY_INLINE Parts nearest_parts(const Points<Columns16<T>>& start, const Points<Columns16<T>>& along,
                                        hn::Vec<Columns16<T>> length, const Points<Columns16<T>>& axis,
                                        hn::Vec<Columns16<T>> whole) {
    const auto zero = hn::Zero(d), one = hn::Set(d, T(1));
    if constexpr (!segment) {
      return {zero, hn::Min(hn::Max(dot_of(d, along, start), zero), length)};
    }
    const auto b = dot_of(d, axis, along), c = dot_of(d, axis, start), f = dot_of(d, along, start);
    const auto sine_squared = one - b * b;
    const auto skew = hn::Gt(sine_squared, hn::Set(d, sizeof(T) == 4 ? T(1e-5) : T(1e-12)));
    const auto free = (b * f - c) / hn::IfThenElse(skew, sine_squared, one);
    const auto clamped = [&](hn::Vec<Columns16<T>> v, hn::Vec<Columns16<T>> most)
                             HWY_ATTR { return hn::Min(hn::Max(v, zero), most); };
    auto s = hn::IfThenElseZero(skew, clamped(free, whole));
    const auto t = clamped(f + b * s, length);
    s = clamped(b * t - c, whole);
    return {s, clamped(f + b * s, length)};
  }

 private:
  static constexpr Columns16<T> d{};
  static constexpr T far_away = T(1e15);  // its square is finite in float

  HWY_INLINE T size() const { return T(p_.outer_radius) + length_ + std::sqrt(dot(from_, from_)); }
  /// A difference of depths well below 10^-4 of the smaller shape.
  HWY_INLINE T sure() const { return T(2e-5) * std::min(T(p_.outer_radius), radius_ + length_ * T(0.5)); }
  HWY_INLINE T rounding() const { return rounding_part * size(); }

  /// The distance by which the plane with normal `outward` separates the core from the polytope; negative if they
  /// overlap along it.
  HWY_INLINE T apart_along(Point<T> outward) const {
    return std::min(dot(outward, from_), dot(outward, to_)) - support<T>(p_, outward);
  }

  /// Finds the face whose plane is farthest from the core; separation_ is the signed distance.
  HWY_INLINE void farthest_face() {
    const auto from = spread_out(d, from_), to = spread_out(d, to_);
    const auto nearness = [&](std::size_t i) HWY_ATTR {
      const auto normal = read(d, p_.normal[0] + i, p_.normal[1] + i, p_.normal[2] + i);
      const auto along = dot_of(d, normal, from);
      return read(d, p_.offset + i) - (segment ? hn::Min(along, dot_of(d, normal, to)) : along);
    };
    Least<T> least(nearness(0));
    for (std::size_t i = hn::Lanes(d); i < p_.faces; i += hn::Lanes(d)) least.add(nearness(i), i);
    face_ = least.index();
    separation_ = -least.value();
    outward_ = normal_of<T>(p_, face_);
  }

  /// The greatest distance along directions perpendicular to the segment and to an edge whose arc of normals holds the
  /// direction. It is stored with its direction if it is greater than that of the faces.
  HWY_INLINE T farthest_crossing() {
    using geometry::EdgeColumn;
    alignas(64) T nearness[max_edges];
    const auto axis = spread_out(d, axis_), from = spread_out(d, from_);
    const auto none = hn::Set(d, std::numeric_limits<T>::max());
    for (std::size_t i = 0; i < p_.edges; i += hn::Lanes(d)) {
      const Crossing found = direction_across(edges(EdgeColumn::left_x, i), edges(EdgeColumn::right_x, i),
                                              edges(EdgeColumn::along_x, i), axis);
      // The minimum of both ends: because of rounding the direction is not exactly perpendicular to a segment parallel
      // to the edge.
      const auto start = dot_of(d, found.outward, minus(d, from, edges(EdgeColumn::from_x, i)));
      const auto end = start + dot_of(d, found.outward, axis) * hn::Set(d, length_);
      const auto distance = hn::Min(start, end) / hn::Sqrt(dot_of(d, found.outward, found.outward));
      hn::Store(hn::IfThenElse(found.valid, hn::Neg(distance), none), d, nearness + i);
    }
    const std::size_t edge = least_of(nearness, p_.edges);
    const T distance = -nearness[edge];
    if (distance <= separation_) return separation_;
    const auto lanes = [&](Point<T> q) HWY_ATTR { return spread_out(d, q); };
    const Crossing found =
        direction_across(lanes(edge_at(EdgeColumn::left_x, edge)), lanes(edge_at(EdgeColumn::right_x, edge)),
                         lanes(along_edge<T>(p_, edge)), axis);
    const Point<T> outward{hn::GetLane(found.outward.x), hn::GetLane(found.outward.y), hn::GetLane(found.outward.z)};
    separation_ = distance;
    outward_ = outward * (T(1) / std::sqrt(dot(outward, outward)));
    return separation_;
  }

  /// The direction on an edge's arc of normals that is perpendicular to the segment, if there is one.
  struct Crossing {
    hn::Mask<Columns16<T>> valid;
    Points<Columns16<T>> outward;
  };
  static HWY_INLINE Crossing direction_across(const Points<Columns16<T>>& left, const Points<Columns16<T>>& right,
                                              const Points<Columns16<T>>& along, const Points<Columns16<T>>& axis) {
    const auto zero = hn::Zero(d);
    const auto p = dot_of(d, left, axis), q = dot_of(d, right, axis);
    // The left normal rotates to the right one about the edge. The cross product is precise except for edges parallel
    // to the segment. For those the weighted mean of the normals is precise; it is not where the normals are nearly
    // opposite.
    const Points<Columns16<T>> product{axis.y * along.z - axis.z * along.y, axis.z * along.x - axis.x * along.z,
                                       axis.x * along.y - axis.y * along.x};
    const auto u = hn::Abs(q), v = hn::Abs(p);
    const Points<Columns16<T>> mean{left.x * u + right.x * v, left.y * u + right.y * v, left.z * u + right.z * v};
    const auto flip = hn::Gt(p, zero);
    const auto skew = hn::Gt(dot_of(d, product, product), hn::Set(d, T(1e-6)));
    const auto choose = [&](hn::Vec<Columns16<T>> of_product, hn::Vec<Columns16<T>> of_mean) HWY_ATTR {
      return hn::IfThenElse(skew, hn::IfThenElse(flip, hn::Neg(of_product), of_product), of_mean);
    };
    const Points<Columns16<T>> outward{choose(product.x, mean.x), choose(product.y, mean.y), choose(product.z, mean.z)};
    const auto valid = hn::And(hn::Lt(p * q, zero), hn::Gt(dot_of(d, outward, outward), hn::Set(d, T(1e-14))));
    return {valid, outward};
  }

  HWY_INLINE Points<Columns16<T>> edges(geometry::EdgeColumn first, std::size_t i) const {
    const float* const x = p_.of(first) + i;
    const std::size_t stride = geometry::padded(p_.edges);
    return read(d, x, x + stride, x + 2 * stride);
  }
  HWY_INLINE Point<T> edge_at(geometry::EdgeColumn first, std::size_t i) const {
    const float* const x = p_.of(first) + i;
    const std::size_t stride = geometry::padded(p_.edges);
    return point_of<T>({x[0], x[stride], x[2 * stride]});
  }

  /// Whether the point of the polytope nearest to the core lies within a face, under an end of the core.
  ///
  /// The distance of a point over a face is its distance from the plane of that face, and no other plane is farther. So
  /// only the farthest plane of each end has to be tested. nearest_edge() finds out whether an edge is nearer.
  HWY_INLINE bool over_a_face() {
    distance_ = far_away;
    if constexpr (segment) {
      under_end(from_);
      under_end(to_);
      return false;
    } else {
      over(face_, separation_, from_);
      return distance_ < far_away;
    }
  }

  HWY_INLINE void under_end(Point<T> end) {
    const auto e = spread_out(d, end);
    const auto nearness = [&](std::size_t i) HWY_ATTR {
      return read(d, p_.offset + i) - dot_of(d, read(d, p_.normal[0] + i, p_.normal[1] + i, p_.normal[2] + i), e);
    };
    Least<T> least(nearness(0));
    for (std::size_t i = hn::Lanes(d); i < p_.faces; i += hn::Lanes(d)) least.add(nearness(i), i);
    over(least.index(), -least.value(), end);
  }

  /// Projects an end on its farthest plane. Takes the projection if it lies within the face and is nearer than the
  /// current result.
  HWY_INLINE void over(std::size_t face, T distance, Point<T> end) {
    if (distance <= T(0) || distance >= distance_) return;
    const Point<T> normal = normal_of<T>(p_, face), foot = end - normal * distance;
    const auto f = spread_out(d, foot);
    // Normals are rounded to float, even where the computation is in double.
    const auto slack = hn::Set(d, (sizeof(T) == 4 ? T(1e-6) : T(2e-7)) * size());
    std::size_t near = 0,
                beyond = 0;  // planes that the projection may be on either side of, and planes that it is outside of
    for (std::size_t i = 0; i < p_.faces; i += hn::Lanes(d)) {
      const auto other = read(d, p_.normal[0] + i, p_.normal[1] + i, p_.normal[2] + i);
      const auto inside = read(d, p_.offset + i) - dot_of(d, other, f);
      beyond += hn::CountTrue(d, hn::Lt(inside, hn::Neg(slack)));
      const std::uint32_t bits = bits_of(d, hn::Lt(inside, slack)) & first_bits(p_.faces - i);
      near += static_cast<std::size_t>(__builtin_popcount(bits));
    }
    // One of them is the face's own plane. At a very sharp edge the projection can be far outside of the face and only
    // slightly outside of any other plane.
    if (beyond > 0 || (near > 1 && !within_face(face, normal, foot))) return;
    distance_ = distance;
    nearest_ = end;
    gap_ = -(normal * distance);
  }

  /// Whether a point of a face's plane lies on the inner side of all edges of the face.
  HWY_NOINLINE bool within_face(std::size_t face, Point<T> normal, Point<T> foot) const {
    for (std::size_t i = 0; i < p_.edges; ++i) {
      const geometry::HullEdge& edge = p_.edge[i];
      if (edge.left != face && edge.right != face) continue;
      const T inside = dot(cross(normal, along_edge<T>(p_, i)), foot - vertex_of<T>(p_, edge.from));
      if ((edge.left == face ? inside : -inside) < -rounding()) return false;
    }
    return true;
  }

  /// Finds the edge nearest to the core; takes it if it is nearer than the current result.
  HWY_INLINE void nearest_edge() {
    using geometry::EdgeColumn;
    const auto from = spread_out(d, from_), axis = spread_out(d, axis_);
    const auto whole = hn::Set(d, length_);
    const auto square = [&](std::size_t i) HWY_ATTR {
      const auto start = minus(d, from, edges(EdgeColumn::from_x, i));
      const auto along = edges(EdgeColumn::along_x, i);
      const auto [s, t] = nearest_parts(start, along, read(d, p_.of(EdgeColumn::length) + i), axis, whole);
      Points<Columns16<T>> at = start;
      if constexpr (segment) at = {at.x + axis.x * s, at.y + axis.y * s, at.z + axis.z * s};
      const Points<Columns16<T>> gap{at.x - along.x * t, at.y - along.y * t, at.z - along.z * t};
      return dot_of(d, gap, gap);
    };
    Least<T> least(square(0));
    for (std::size_t i = hn::Lanes(d); i < p_.edges; i += hn::Lanes(d)) least.add(square(i), i);
    const T distance = std::sqrt(least.value());
    if (distance >= distance_) return;
    if (sizeof(T) == 4) {
      measure_edge(least.index());
      return;
    }
    // The columns are in float, so several edges may be the nearest one.
    const T most = distance + T(5e-7) * size();
    const auto most_squared = hn::Set(d, most * most);
    for (std::size_t i = 0; i < p_.edges; i += hn::Lanes(d)) {
      std::uint32_t near = bits_of(d, hn::Le(square(i), most_squared)) & first_bits(p_.edges - i);
      for (; near != 0; near &= near - 1) measure_edge(i + static_cast<std::size_t>(__builtin_ctz(near)));
    }
  }

  /// Computes the nearest points of the core and an edge; takes them if they are nearer than the current result.
  HWY_INLINE void measure_edge(std::size_t edge) {
    const auto axis = spread_out(d, axis_);
    const auto whole = hn::Set(d, length_);
    const auto point = [&](Point<T> q) HWY_ATTR { return spread_out(d, q); };
    const Point<T> start = from_ - vertex_of<T>(p_, p_.edge[edge].from), along = along_edge<T>(p_, edge);
    const auto length = hn::Set(d, edge_length<T>(p_, edge));
    const auto parts = nearest_parts(point(start), point(along), length, axis, whole);
    const T s = hn::GetLane(parts.of_core), t = hn::GetLane(parts.of_edge);
    const Point<T> gap = along * t - (start + axis_ * s);
    const T distance = std::sqrt(dot(gap, gap));
    if (distance >= distance_) return;
    distance_ = distance;
    nearest_ = from_ + axis_ * s;
    gap_ = gap;
  }

  /// The contact of a core that reaches inside: along the direction of greatest separation.
  HWY_INLINE Overlap<T> from_inside(T distance) const {
    const T inverse = T(1) / std::sqrt(dot(outward_, outward_));
    const Point<T> normal = -(outward_ * inverse);
    const T depth = radius_ - distance * inverse;
    // Midway between the farthest point of the round body and the farthest point of the polytope, along the normal.
    const T from_height = dot(normal, from_), to_height = dot(normal, to_);
    const T height = (std::max(from_height, to_height) + radius_) - depth * T(0.5);
    const Point<T> deepest = deepest_point(normal, from_height, to_height);
    return {depth, normal, deepest + normal * (height - dot(normal, deepest))};
  }

  HWY_INLINE Point<T> deepest_point(Point<T> normal, T from_height, T to_height) const {
    const T slack = (sizeof(T) == 4 ? T(3e-6) : T(1.5e-7)) * size();
    if (!segment || length_ == T(0) || from_height > to_height + slack) return from_;
    if (to_height > from_height + slack) return to_;
    return shared_point(normal, slack);
  }

  HWY_NOINLINE Point<T> shared_point(Point<T> normal, T slack) const {
    const auto in_double = [](Point<T> q) { return Vec3d{double(q.x), double(q.y), double(q.z)}; };
    const Vec3d core[2] = {in_double(from_), in_double(to_)};
    FeaturePoints corners;
    const T farthest = support<T>(p_, -normal);
    for (std::size_t i = 0; i < p_.vertices; ++i) {
      const Point<T> v = vertex_of<T>(p_, i);
      if (dot(-normal, v) >= farthest - slack) corners.add(in_double(v));
    }
    const Vec3d q = common_point(core, corners.get(), in_double(normal));
    return {static_cast<T>(q.x), static_cast<T>(q.y), static_cast<T>(q.z)};
  }

  const Polytope& p_;
  const Point<T> from_, to_;
  const T radius_;
  T length_;
  Point<T> axis_;         // unit direction from from_ to to_; zero for a sphere
  std::size_t face_ = 0;  // the face whose plane is farthest from the core
  T separation_ =
      0;  // the distance by which the plane with normal outward_ separates core and polytope; negative inside
  Point<T> outward_{};
  T distance_ = 0;  // distance of the nearest points
  WorkCounts work_;
  Point<T> nearest_{}, gap_{};  // the core's nearest point, and the vector from there to the polytope's
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
