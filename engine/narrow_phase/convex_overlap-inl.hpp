// Two convex polytopes: whether they overlap and the least translation that separates them. Included once for each
// Highway target.
//
// The least depth is the least reach(n) = support of a along n + support of b along -n over all directions n, and it is
// taken where n is the normal of a face of the Minkowski difference: of a face of a, of a face of b, or across an edge
// of each whose arcs of normals cross (the Gauss map; Gregorius, "The Separating Axis Test", 2013). All of them are
// candidates here; what keeps it fast is that a ball inside one shape, seen from a face or an edge of the other, bounds
// reach from below, so that only few face normals and few edges can beat the best direction known. Any direction of
// negative reach separates, and the first one tried, between the centres, finds most of those there are.
//
// It ends: every stage walks a list once. Nearly parallel edges and nearly touching arcs are judged by their true
// reach, so that rounding can never make an answer less than the depth along its own normal.

#if defined(RINGFENCE_NARROW_PHASE_CONVEX_OVERLAP_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_CONVEX_OVERLAP_INL
#undef RINGFENCE_NARROW_PHASE_CONVEX_OVERLAP_INL
#else
#define RINGFENCE_NARROW_PHASE_CONVEX_OVERLAP_INL
#endif

#include <array>
#include <cmath>

#include "narrow_phase/convex_features.hpp"
#include "narrow_phase/convex_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// How deep two shapes overlap, in the axes of the first and about its origin.
template <class T>
struct Overlap {
  T depth;
  Point<T> normal;  ///< unit, from the first to the second
  Point<T> point;
};

/// Sines below which rounding decides: arcs of normals that just miss are tried too, those that just meet and edges
/// nearly parallel are judged by their true reach, and edges closer to parallel have no direction across.
template <class T>
struct Rounding {
  static constexpr T miss = sizeof(T) == 4 ? T(1e-6) : T(3e-7);
  static constexpr T sure = T(1e-5);
  static constexpr T sure_sine_squared = T(1e-4);
  static constexpr T parallel_sine_squared = sizeof(T) == 4 ? T(1e-12) : T(1e-20);
  /// Part of the two sizes that a reach may be off by; candidates are kept by that much more.
  static constexpr T reach = sizeof(T) == 4 ? T(1e-6) : T(2e-8);
  /// Part of the two sizes by which vertices of one feature may differ in height. Normals of faces are in float.
  static constexpr T height = sizeof(T) == 4 ? T(3e-6) : T(1.5e-7);
};

template <class T>
class PolytopePair {
 public:
  /// `turn` and `offset` place `b` in the axes of `a`.
  HWY_INLINE PolytopePair(const Polytope& a, const Polytope& b, const Turn<T>& turn, Point<T> offset)
      : a_(a), b_(b), turn_(turn), offset_(offset) {}

  /// Whether they overlap or touch; if so `out` says how.
  bool test(Overlap<T>& out) {
    centre_of_b_ = rotate(turn_, point_of<T>(b_.centre)) + offset_;
    if (separated_by_centres()) return false;
    if (separated_by_faces()) return false;
    add_deepest_of_a(direction_);
    add_deepest_of_b(-rotate_back(turn_, direction_));
    const T after_faces = best_;
    const Point<T> direction_after_faces = direction_;
    if (separated_by_edges(false)) return false;
    out = measured();
    if (out.depth > best_ + Rounding<T>::sure * (best_ + size())) {
      // An edge pair that was taken for sure was none: never seen, but then each is judged by its true reach.
      best_ = after_faces;
      direction_ = direction_after_faces;
      if (separated_by_edges(true)) return false;
      out = measured();
    }
    return true;
  }

  const Work& work() const { return work_; }

 private:
  static constexpr Columns16<T> d{};
  using Lanes = hn::Vec<Columns16<T>>;

  /// Columns of faces or edges that were kept, one after the other.
  template <std::size_t Columns, std::size_t Most>
  struct Kept {
    alignas(64) T value[Columns * Most];
    std::uint16_t index[Most];
    std::size_t count = 0, stride = 0;

    T* column(std::size_t c) { return value + c * stride; }
  };

  /// Vertices of one shape that turned out deepest along some direction, in the axes of the other: points inside it,
  /// each of which bounds reach from below.
  struct Inside {
    Point<T> points[4];
    std::size_t count = 0;

    void add(Point<T> p) { points[count++] = p; }
  };
  std::size_t add_deepest_of_a(Point<T> direction) {
    const std::size_t vertex = farthest_vertex<T>(a_, direction);
    of_a_.add(rotate_back(turn_, vertex_of<T>(a_, vertex) - offset_));
    return vertex;
  }
  std::size_t add_deepest_of_b(Point<T> direction_in_b) {
    const std::size_t vertex = farthest_vertex<T>(b_, direction_in_b);
    of_b_.add(vertex_of_b(vertex));
    return vertex;
  }

  HWY_INLINE T size() const { return T(a_.outer_radius) + T(b_.outer_radius); }

  /// What a candidate's bound has to be below, if a ball of `inner_radius` is to be added to it.
  HWY_INLINE T limit(float inner_radius) const { return (best_ - T(inner_radius)) + Rounding<T>::reach * size(); }

  HWY_INLINE T reach(Point<T> direction) const {
    return (support<T>(a_, direction) + support<T>(b_, -rotate_back(turn_, direction))) - dot(direction, offset_);
  }

  /// Takes note of a unit direction; whether it separates.
  HWY_INLINE bool separates(Point<T> direction, T value) {
    if (value < best_) {
      best_ = value;
      direction_ = direction;
    }
    return value < T(0);
  }

  bool separated_by_centres() {
    Point<T> axis = centre_of_b_ - point_of<T>(a_.centre);
    T squared = dot(axis, axis);
    if (!(squared > T(1e-20))) {
      axis = {T(1), T(0), T(0)};
      squared = T(1);
    }
    const T value = reach(axis);
    work_.directions = 1;
    work_.pass<T>(a_.vertices);
    work_.pass<T>(b_.vertices);
    if (value < T(0)) return true;
    const T inverse = T(1) / std::sqrt(squared);
    best_ = value * inverse;
    direction_ = axis * inverse;
    add_deepest_of_a(axis);
    add_deepest_of_b(-rotate_back(turn_, axis));
    return false;
  }

  /// For each face the distance from `centre` to its plane, positive inside.
  static void distances(const Polytope& p, Point<T> centre, T* out) {
    const auto c = spread_out(d, centre);
    for (std::size_t i = 0; i < p.faces; i += hn::Lanes(d)) {
      const auto normal = read(d, p.normal[0] + i, p.normal[1] + i, p.normal[2] + i);
      hn::Store(read(d, p.offset + i) - dot_of(d, normal, c), d, out + i);
    }
  }

  bool separated_by_faces() {
    alignas(64) T of_a[max_faces], of_b[max_faces];
    const Point<T> centre_of_a_in_b = rotate_back(turn_, point_of<T>(a_.centre) - offset_);
    distances(a_, centre_of_b_, of_a);
    distances(b_, centre_of_a_in_b, of_b);
    work_.pass<T>(a_.faces);
    work_.pass<T>(b_.faces);
    // The face that the other's centre is farthest out of is often the one, and a good bound for all others.
    if (face_separates(a_, b_, least_of(of_a, a_.faces), true)) return true;
    if (face_separates(b_, a_, least_of(of_b, b_.faces), false)) return true;
    if (others_separate(a_, b_, of_a, true)) return true;
    return others_separate(b_, a_, of_b, false);
  }

  /// The direction from a to b across a face of one of them, in the axes of a and of the one that has not the face.
  struct FaceDirection {
    Point<T> from_a_to_b, in_other;
  };
  HWY_INLINE FaceDirection direction_of(Point<T> normal, bool of_a) const {
    if (of_a) return {normal, -rotate_back(turn_, normal)};
    const Point<T> turned_normal = -rotate(turn_, normal);
    return {turned_normal, turned_normal};
  }

  bool face_separates(const Polytope& own, const Polytope& other, std::size_t face, bool of_a) {
    const Point<T> normal = point_of<T>({own.normal[0][face], own.normal[1][face], own.normal[2][face]});
    const FaceDirection way = direction_of(normal, of_a);
    ++work_.directions;
    work_.pass<T>(other.vertices);
    const std::size_t deepest = of_a ? add_deepest_of_b(way.in_other) : add_deepest_of_a(way.in_other);
    const T support = dot(vertex_of<T>(other, deepest), way.in_other);
    const T value = (T(own.offset[face]) + support) - dot(way.from_a_to_b, offset_);
    return separates(way.from_a_to_b, value);
  }

  /// Judges all faces that the ball and the points inside the other leave a chance.
  bool others_separate(const Polytope& own, const Polytope& other, const T* distance, bool of_a) {
    const auto most = hn::Set(d, limit(other.inner_radius));
    Kept<4, max_faces> kept;
    kept.stride = geometry::padded(own.faces);
    const auto limit_of_point = hn::Set(d, limit(0));
    const Inside& inside = of_a ? of_b_ : of_a_;
    for (std::size_t i = 0; i < own.faces; i += hn::Lanes(d)) {
      auto chance = hn::Lt(hn::Load(d, distance + i), most);
      const auto normal = read(d, own.normal[0] + i, own.normal[1] + i, own.normal[2] + i);
      for (std::size_t k = 0; k < inside.count && !hn::AllFalse(d, chance); ++k) {
        const auto depth = read(d, own.offset + i) - dot_of(d, normal, spread_out(d, inside.points[k]));
        chance = hn::And(chance, hn::Lt(depth, limit_of_point));
      }
      std::uint32_t bits = bits_of(d, chance) & first_bits(own.faces - i);
      for (; bits != 0; bits &= bits - 1) {
        const std::size_t face = i + static_cast<std::size_t>(__builtin_ctz(bits));
        for (std::size_t c = 0; c < 3; ++c) kept.column(c)[kept.count] = T(own.normal[c][face]);
        kept.column(3)[kept.count] = T(own.offset[face]);
        ++kept.count;
      }
    }
    work_.pass<T>(own.faces);
    if (kept.count == 0) return false;
    work_.directions += kept.count;
    for (std::size_t v = 0; v < other.vertices; ++v) work_.pass<T>(kept.count);
    pad(kept, 4);
    for (std::size_t i = 0; i < kept.count; i += hn::Lanes(d)) judge_faces(other, kept, i, of_a);
    const std::size_t best = least_of(kept.column(3), kept.count);
    const Point<T> normal{kept.column(0)[best], kept.column(1)[best], kept.column(2)[best]};
    return separates(direction_of(normal, of_a).from_a_to_b, kept.column(3)[best]);
  }

  /// Replaces the offsets of one vector of kept faces by their reach.
  template <class KeptFaces>
  void judge_faces(const Polytope& other, KeptFaces& kept, std::size_t i, bool of_a) {
    const Points<Columns16<T>> normal{hn::Load(d, kept.column(0) + i), hn::Load(d, kept.column(1) + i),
                                      hn::Load(d, kept.column(2) + i)};
    const auto inward = of_a ? turned_back(d, turn_, normal) : turned(d, turn_, normal);
    const Points<Columns16<T>> way{hn::Neg(inward.x), hn::Neg(inward.y), hn::Neg(inward.z)};
    // Four at a time: the chain of maxima would otherwise wait for itself.
    Lanes most[4];
    for (int k = 0; k < 4; ++k) most[k] = at_vertex(other, way, static_cast<std::size_t>(k));
    for (std::size_t v = 4; v < other.vertices; v += 4) {
      for (int k = 0; k < 4; ++k) {
        most[k] = hn::Max(most[k], at_vertex(other, way, v + static_cast<std::size_t>(k)));
      }
    }
    const auto farthest = hn::Max(hn::Max(most[0], most[1]), hn::Max(most[2], most[3]));
    const auto along = dot_of(d, of_a ? normal : way, spread_out(d, offset_));
    hn::Store((hn::Load(d, kept.column(3) + i) + farthest) - along, d, kept.column(3) + i);
  }

  static HWY_INLINE Lanes at_vertex(const Polytope& p, const Points<Columns16<T>>& way, std::size_t v) {
    return hn::Set(d, T(p.vertex[0][v])) * way.x + hn::Set(d, T(p.vertex[1][v])) * way.y +
           hn::Set(d, T(p.vertex[2][v])) * way.z;
  }

  /// Repeats the first of what was kept to the end of the last vector.
  template <class K>
  static HWY_INLINE void pad(K& kept, std::size_t columns) {
    for (std::size_t i = kept.count; i % geometry::hull_lanes != 0; ++i) {
      for (std::size_t c = 0; c < columns; ++c) kept.column(c)[i] = kept.column(c)[0];
    }
  }

  /// The edges that the ball and the points inside the other leave a chance: reach along the arc between the two
  /// normals is at least that of a point of the other, which is least at an end of the arc or, where it is negative, at
  /// most the spread below.
  std::size_t list_edges(const Polytope& own, Point<T> other_centre, float other_radius, const Inside& inside,
                         std::uint16_t* out) const {
    using geometry::EdgeColumn;
    const auto centre = spread_out(d, other_centre);
    const auto limit_of_ball = hn::Set(d, limit(other_radius)), limit_of_point = hn::Set(d, limit(0));
    std::size_t count = 0;
    for (std::size_t i = 0; i < own.edges; i += hn::Lanes(d)) {
      const auto start = read_edges(own, EdgeColumn::from_x, i);
      const auto left = read_edges(own, EdgeColumn::left_x, i), right = read_edges(own, EdgeColumn::right_x, i);
      const auto spread = read(d, own.of(EdgeColumn::spread) + i);
      const auto least_from = [&](const Points<Columns16<T>>& point) HWY_ATTR {
        const auto from = minus(d, start, point);
        const auto nearer = hn::Min(dot_of(d, left, from), dot_of(d, right, from));
        return hn::Min(nearer, nearer * spread);
      };
      auto chance = hn::Lt(least_from(centre), limit_of_ball);
      for (std::size_t k = 0; k < inside.count && !hn::AllFalse(d, chance); ++k) {
        chance = hn::And(chance, hn::Lt(least_from(spread_out(d, inside.points[k])), limit_of_point));
      }
      std::uint32_t bits = bits_of(d, chance) & first_bits(own.edges - i);
      for (; bits != 0; bits &= bits - 1) {
        out[count++] = static_cast<std::uint16_t>(i + static_cast<std::size_t>(__builtin_ctz(bits)));
      }
    }
    return count;
  }

  static HWY_INLINE Points<Columns16<T>> read_edges(const Polytope& p, geometry::EdgeColumn first, std::size_t i) {
    const std::size_t c = static_cast<std::size_t>(first);
    return read(d, p.edge[c] + i, p.edge[c + 1] + i, p.edge[c + 2] + i);
  }
  static HWY_INLINE Point<T> edge_at(const Polytope& p, geometry::EdgeColumn first, std::size_t i) {
    const std::size_t c = static_cast<std::size_t>(first);
    return point_of<T>({p.edge[c][i], p.edge[c + 1][i], p.edge[c + 2][i]});
  }

  /// Columns of the kept edges of b, in the axes of a: normals left and right, a point, the direction.
  using KeptEdges = Kept<12, max_edges>;

  void place_edges(KeptEdges& kept) const {
    kept.stride = geometry::padded(kept.count);
    for (std::size_t i = 0; i < kept.count; ++i) {
      for (std::size_t c = 0; c < 9; ++c) kept.column(c)[i] = T(b_.edge[c][kept.index[i]]);
      const Point<T> along = along_edge<T>(b_, kept.index[i]);
      kept.column(9)[i] = along.x;
      kept.column(10)[i] = along.y;
      kept.column(11)[i] = along.z;
    }
    pad(kept, 12);
    for (std::size_t i = 0; i < kept.count; i += hn::Lanes(d)) {
      for (std::size_t c = 0; c < 12; c += 3) {
        auto p = turned(d, turn_, load(kept, c, i));
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

  bool separated_by_edges(bool doubt_all) {
    std::uint16_t of_a[max_edges];
    const std::size_t count = list_edges(a_, centre_of_b_, b_.inner_radius, of_b_, of_a);
    if (count == 0) return false;
    KeptEdges of_b;
    const Point<T> centre_of_a_in_b = rotate_back(turn_, point_of<T>(a_.centre) - offset_);
    of_b.count = list_edges(b_, centre_of_a_in_b, a_.inner_radius, of_a_, of_b.index);
    work_.pass<T>(a_.edges);
    work_.pass<T>(b_.edges);
    if (of_b.count == 0) return false;
    place_edges(of_b);
    for (std::size_t i = 0; i < count; ++i) work_.pass<T>(of_b.count);
    for (std::size_t i = 0; i < count; ++i) {
      if (edge_separates(of_a[i], of_b, doubt_all)) return true;
    }
    return false;
  }

  /// One edge of a against all kept edges of b.
  bool edge_separates(std::size_t edge, KeptEdges& of_b, bool doubt_all) {
    using geometry::EdgeColumn;
    const Point<T> left = edge_at(a_, EdgeColumn::left_x, edge), right = edge_at(a_, EdgeColumn::right_x, edge);
    const Point<T> from = edge_at(a_, EdgeColumn::from_x, edge), along = along_edge<T>(a_, edge);
    const auto left_a = spread_out(d, left), right_a = spread_out(d, right);
    const auto from_a = spread_out(d, from), along_a = spread_out(d, along);
    const auto miss = hn::Set(d, -Rounding<T>::miss);
    // Against one limit for the whole row, so that what is judged does not depend on the width.
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
      if (pair_separates(left, right, from, along, of_b, chosen[i], doubt_all)) return true;
    }
    return false;
  }

  bool pair_separates(Point<T> left, Point<T> right, Point<T> from, Point<T> along, KeptEdges& of_b, std::size_t other,
                      bool doubt_all) {
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
    if (sure && value >= T(0) && !doubt_all) return separates(direction, value);
    return separates(direction, reach(direction));
  }

  /// The vertices that lie within rounding of the farthest along a direction.
  struct Feature {
    std::array<std::uint16_t, geometry::max_hull_vertices> vertex;
    std::size_t count = 0;
    T height;
  };
  static void find_feature(const Polytope& p, Point<T> direction, T slack, Feature& out) {
    alignas(64) T heights[geometry::max_hull_vertices];
    const auto way = spread_out(d, direction);
    auto most = hn::Set(d, -std::numeric_limits<T>::infinity());
    for (std::size_t i = 0; i < p.vertices; i += hn::Lanes(d)) {
      const auto height = dot_of(d, read(d, p.vertex[0] + i, p.vertex[1] + i, p.vertex[2] + i), way);
      most = hn::Max(most, height);
      hn::Store(height, d, heights + i);
    }
    out.height = hn::GetLane(hn::MaxOfLanes(d, most));
    const auto least = hn::Set(d, out.height - slack);
    for (std::size_t i = 0; i < p.vertices; i += hn::Lanes(d)) {
      std::uint32_t bits = bits_of(d, hn::Ge(hn::Load(d, heights + i), least)) & first_bits(p.vertices - i);
      for (; bits != 0; bits &= bits - 1) {
        out.vertex[out.count++] = static_cast<std::uint16_t>(i + static_cast<std::size_t>(__builtin_ctz(bits)));
      }
    }
  }

  HWY_INLINE Point<T> vertex_of_a(std::size_t i) const { return vertex_of<T>(a_, i); }
  HWY_INLINE Point<T> vertex_of_b(std::size_t i) const { return rotate(turn_, vertex_of<T>(b_, i)) + offset_; }

  /// Depth and point along the best direction.
  Overlap<T> measured() const {
    const T inverse = T(1) / std::sqrt(dot(direction_, direction_));
    const Point<T> normal = direction_ * inverse;
    const T slack = Rounding<T>::height * size();
    Feature of_a, of_b;
    find_feature(a_, normal, slack, of_a);
    find_feature(b_, -rotate_back(turn_, normal), slack, of_b);
    const T depth = (of_a.height + of_b.height) - dot(normal, offset_);
    Overlap<T> result{depth > T(0) ? depth : T(0), normal, {}};
    if (of_b.count == 1) {
      result.point = vertex_of_b(of_b.vertex[0]) + normal * (depth * T(0.5));
    } else if (of_a.count == 1) {
      result.point = vertex_of_a(of_a.vertex[0]) - normal * (depth * T(0.5));
    } else {
      result.point = shared_point(of_a, of_b, normal, of_a.height - depth * T(0.5));
    }
    return result;
  }

  HWY_NOINLINE Point<T> shared_point(const Feature& of_a, const Feature& of_b, Point<T> normal, T height) const {
    Vec3d first[geometry::max_hull_vertices], second[geometry::max_hull_vertices];
    const auto in_double = [](Point<T> p) { return Vec3d{double(p.x), double(p.y), double(p.z)}; };
    for (std::size_t i = 0; i < of_a.count; ++i) first[i] = in_double(vertex_of_a(of_a.vertex[i]));
    for (std::size_t i = 0; i < of_b.count; ++i) second[i] = in_double(vertex_of_b(of_b.vertex[i]));
    const Vec3d p = meeting_point({first, of_a.count}, {second, of_b.count}, in_double(normal));
    const Point<T> across{static_cast<T>(p.x), static_cast<T>(p.y), static_cast<T>(p.z)};
    return across + normal * height;
  }

  const Polytope& a_;
  const Polytope& b_;
  const Turn<T> turn_;
  const Point<T> offset_;
  Point<T> centre_of_b_;
  Work work_;
  Inside of_a_, of_b_;    // of a in the axes of b, of b in those of a
  T best_ = 0;            // the least reach found
  Point<T> direction_{};  // along this direction, from a to b
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
