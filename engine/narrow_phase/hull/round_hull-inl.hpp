// Spheres and capsules against hulls, in blocks of pairs. Included once for each Highway target.
//
// If the core (a point or a segment) is outside the hull, the nearest point of the hull usually lies on the face whose
// plane is farthest from the core. So only the edges of this face are evaluated, one edge per lane, of any pair of the
// block. Then the result is verified. Where the end of the core lies over the face, no point of the hull is nearer than
// the plane. Otherwise two points are the nearest ones if the plane perpendicular to the line between them separates
// the shapes by their whole distance. (Projection on a convex set: no vertex w has a positive product of p - q and w -
// q.)
//
// Pairs that cannot be verified, and cores inside the hull for which faces are not enough, are left to the test of
// single pairs, which is exhaustive.

#if defined(RINGFENCE_NARROW_PHASE_ROUND_HULL_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_ROUND_HULL_INL
#undef RINGFENCE_NARROW_PHASE_ROUND_HULL_INL
#else
#define RINGFENCE_NARROW_PHASE_ROUND_HULL_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/hull_block-inl.hpp"
#include "narrow_phase/hull/hull_edges-inl.hpp"
#include "narrow_phase/hull/round_pair-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Up to block_pairs pairs of a sphere or capsule with a hull. Everything is in the axes of the hull, relative to its
/// origin.
template <bool segment>
class RoundHullBlock {
 public:
  RoundHullBlock(const KernelInput& input, const KernelPair* pairs, std::size_t count, WorkCounts& work)
      : input_(input), count_(count), work_(work) {
    std::fill(std::copy_n(pairs, count, pairs_), pairs_ + block_pairs, pairs[count - 1]);
    for (std::size_t i = 0; i < block_pairs; ++i) {
      hull_[i] = &input.shapes.hull(input.shapes.row(input.bodies[pairs_[i].second].shape).index_in_kind);
      size_[i] = hull_[i]->bounding_radius();
    }
    for (std::size_t i = 0; i < block_pairs; i += lanes)
      place(gather<Kinds>(d, input, AdjacentPairs<KernelPair>{pairs_ + i}), i);
  }

  PairContact* test(PairContact* out) {
    found_.clear();
    find_farthest_faces();
    classify_pairs();
    try_face_edges();
    compute_contacts();
    return write_found(out);
  }

 private:
  using Kinds = KindsOf<segment ? ShapeKind::capsule : ShapeKind::sphere, ShapeKind::hull>;
  using D = Columns16<float>;
  using V = hn::Vec<D>;
  static constexpr D d{};
  static constexpr std::size_t lanes = hn::MaxLanes(D());
  using Column = float[block_pairs];
  using Column3 = float[3][block_pairs];

  void place(const Lanes<D>& in, std::size_t i) {
    const Rotation<D> to_world = rotation(d, in.second_orientation);
    const Vector<D> centre = negate(d, unrotate(d, to_world, in.offset));
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) hn::Store(to_world.m[k][j], d, rotation_[k][j] + i);
    }
    store(d, in.offset, offset_, i);
    store(d, centre, centre_, i);
    hn::Store(in.first_size.x, d, radius_ + i);
    Vector<D> from = centre;
    V length = hn::Zero(d);
    if constexpr (segment) {
      const Vector<D> half = scale(d, unrotate(d, to_world, z_axis(d, in.first_orientation)), in.first_size.y);
      from = subtract(d, centre, half);
      const Vector<D> to = add(d, centre, half), axis = subtract(d, to, from);
      length = hn::Sqrt(dot(d, axis, axis));
      const auto some = hn::Gt(length, hn::Zero(d));
      const V inverse = hn::IfThenElseZero(some, hn::Set(d, 1.0f) / hn::IfThenElse(some, length, hn::Set(d, 1.0f)));
      store(d, from, from_, i);
      store(d, to, to_, i);
      store(d, scale(d, axis, inverse), axis_, i);
      hn::Store(length, d, length_ + i);
    }
    hn::Store(hn::Load(d, size_ + i) + length + hn::Sqrt(dot(d, from, from)), d, size_ + i);
  }

  HWY_INLINE const Column3& start() const { return segment ? from_ : centre_; }

  /// Finds the face of each hull whose plane is farthest from the core; separation_ is the distance by which the core
  /// lies outside of that plane, negative inside.
  void find_farthest_faces() {
    for (std::size_t i = 0; i < count_; ++i) {
      const geometry::Hull& hull = *hull_[i];
      const auto from = spread_out(d, at(start(), i)), to = spread_out(d, at(segment ? to_ : centre_, i));
      const auto nearness = [&](std::size_t f) HWY_ATTR {
        const auto normal = read(d, hull.normal_x() + f, hull.normal_y() + f, hull.normal_z() + f);
        const V along = dot_of(d, normal, from);
        return hn::Load(d, hull.offset() + f) - (segment ? hn::Min(along, dot_of(d, normal, to)) : along);
      };
      Least<float> least(nearness(0));
      for (std::size_t f = lanes; f < hull.face_count(); f += lanes) least.add(nearness(f), f);
      const std::size_t face = least.index();
      const Vec3f outward = hull.normal(face);
      face_[i] = static_cast<std::uint32_t>(face);
      separation_[i] = -least.value();
      outward_[0][i] = outward.x;
      outward_[1][i] = outward.y;
      outward_[2][i] = outward.z;
      work_.directions += hull.face_count();
      work_.pass<float>(hull.face_count());
    }
  }

  /// Decides the pairs that a face separates, and points inside, for which the nearest face decides. Pairs in doubt are
  /// marked; in the others the core is outside.
  void classify_pairs() {
    alignas(64) std::uint32_t outside[block_pairs], fallback[block_pairs];
    for (std::size_t i = 0; i < block_pairs; i += lanes) {
      const hn::RebindToUnsigned<D> bits;
      const auto put = [&](hn::Mask<D> mask, std::uint32_t* to)
                           HWY_ATTR { hn::Store(hn::BitCast(bits, hn::VecFromMask(d, mask)), bits, to + i); };
      const V depth = hn::Load(d, separation_ + i), radius = hn::Load(d, radius_ + i);
      const V doubtful = hn::Set(d, RoundPair<float, segment>::doubtful) * hn::Load(d, size_ + i);
      const auto near = hn::Le(depth, radius);
      put(hn::And(near, hn::Ge(depth, doubtful)), outside);
      if constexpr (segment) {
        put(hn::And(near, hn::Lt(depth, doubtful)), fallback);
      } else {
        put(hn::And(near, hn::Lt(hn::Abs(depth), doubtful)), fallback);
        const Vector<D> n = load(d, outward_, i);
        const V inverse = hn::Set(d, 1.0f) / hn::Sqrt(dot(d, n, n));
        const Vector<D> normal = negate(d, scale(d, n, inverse));
        const V overlap = radius - depth * inverse;
        hn::Store(overlap, d, found_.depth + i);
        store(d, normal, found_.normal, i);
        store(d, scale(d, normal, radius - overlap * hn::Set(d, 0.5f)), found_.point, i);
        put(hn::And(near, hn::Le(depth, hn::Neg(doubtful))), found_.hit);
      }
    }
    for (std::uint32_t i = 0; i < count_; ++i) fallback_mask_ |= (fallback[i] & 1) << i;
    outside_.count = count_;
    for (std::uint32_t i = 0; i < count_; ++i) outside_.pair[i] = i;
    outside_.keep([&](std::size_t i) { return outside[i] != 0; });
    for (std::size_t u = 0; u < outside_.count; ++u) {
      const std::size_t i = outside_.pair[u];
      const auto row = [&](int r, const Column3& p, float fourth) HWY_ATTR {
        for (int k = 0; k < 3; ++k) rows_[i][r][k] = p[k][i];
        rows_[i][r][3] = fourth;
      };
      row(0, start(), 0);
      row(1, outward_, 0);
      if (segment) row(2, axis_, length_[i]);
    }
  }

  /// An edge of the farthest face.
  struct Item {
    static constexpr int pair_bit = 16;
    static constexpr std::uint32_t right = 0x8000;  ///< the face is to the right of the edge
    std::uint32_t word;
    std::size_t pair() const { return word >> pair_bit; }
    std::size_t edge() const { return word & (right - 1); }
  };
  static constexpr std::size_t room = 1024;

  /// The results for some edges, in the order of their pairs.
  struct Items {
    std::uint32_t item[room + 4];
    std::size_t count = 0;
    alignas(64) float square[room], inside[room], part[room], gap[3][room];
  };

  void try_face_edges() {
    Items items;
    std::size_t first = 0;  // first pair whose edges are in `items`
    for (std::size_t u = 0; u < outside_.count; ++u) {
      const std::size_t i = outside_.pair[u];
      if (items.count + hull_[i]->edge_count() > room - lanes) {
        evaluate_edges(items, first, u);
        items.count = 0;
        first = u;
      }
      const Polytope hull = polytope_of(*hull_[i]);
      const auto tag = static_cast<std::uint32_t>(i << Item::pair_bit);
      items.count += list_edges_of_face(hull, face_[i], tag, tag | Item::right, items.item + items.count);
    }
    evaluate_edges(items, first, outside_.count);
  }

  void evaluate_edges(Items& items, std::size_t first, std::size_t end) {
    for (std::size_t begin = 0; begin < items.count; begin += lanes) evaluate_vector(items, begin);
    std::size_t k = 0;
    for (std::size_t u = first; u < end; ++u) choose_nearest(items, k, outside_.pair[u]);
  }

  void evaluate_vector(Items& items, std::size_t begin) {
    const std::size_t count = std::min(lanes, items.count - begin);
    const float *edge[lanes], *pair[lanes];
    alignas(64) float lengths[lanes];
    alignas(64) std::uint32_t flips[lanes];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const Item item{items.item[begin + (lane < count ? lane : 0)]};
      const geometry::HullEdge& its = hull_[item.pair()]->edges()[item.edge()];
      edge[lane] = &its.left_normal.x;
      lengths[lane] = its.length;
      pair[lane] = rows_[item.pair()][0];
      flips[lane] = (item.word & Item::right) << 16;
    }
    work_.lanes += lanes;
    work_.filled += count;
    work_.directions += count;
    V left[4], right[4], along[4], start[4], outward[4], axis[4];
    const auto gather = [&](const float* const* of, std::size_t row, V* out) HWY_ATTR {
      gather_rows(
          d, [&](std::size_t lane) { return of[lane] + 4 * row; }, out);
    };
    gather(edge, 0, left);
    gather(edge, 1, right);
    gather(edge, 2, along);
    gather(pair, 0, start);
    gather(pair, 1, outward);
    const V zero = hn::Zero(d);
    if constexpr (segment) {
      gather(pair, 2, axis);
    } else {
      axis[0] = axis[1] = axis[2] = axis[3] = zero;
    }
    using P = Points<D>;
    const P a{along[0], along[1], along[2]}, w{axis[0], axis[1], axis[2]}, n{outward[0], outward[1], outward[2]};
    const P from{start[0] - left[3], start[1] - right[3], start[2] - along[3]};
    const auto parts = RoundPair<float, segment>::nearest_parts(from, a, hn::Load(d, lengths), w, axis[3]);
    P core = from;
    V end = zero;  // the position on the core of the end that is nearer to the plane
    if constexpr (segment) {
      const auto& s = parts.of_core;
      core = {from.x + w.x * s, from.y + w.y * s, from.z + w.z * s};
      end = hn::IfThenElseZero(hn::Lt(dot_of(d, n, w), zero), axis[3]);
    }
    const V t = parts.of_edge;
    const P gap{a.x * t - core.x, a.y * t - core.y, a.z * t - core.z};
    const P over{from.x + w.x * end, from.y + w.y * end, from.z + w.z * end};
    const V inside =
        over.x * (n.y * a.z - n.z * a.y) + over.y * (n.z * a.x - n.x * a.z) + over.z * (n.x * a.y - n.y * a.x);
    const hn::RebindToUnsigned<D> bits;
    hn::Store(dot_of(d, gap, gap), d, items.square + begin);
    hn::Store(hn::Xor(inside, hn::BitCast(d, hn::Load(bits, flips))), d, items.inside + begin);
    hn::Store(parts.of_core, d, items.part + begin);
    hn::Store(gap.x, d, items.gap[0] + begin);
    hn::Store(gap.y, d, items.gap[1] + begin);
    hn::Store(gap.z, d, items.gap[2] + begin);
  }

  /// Chooses the nearest edge of the face, or the face itself. `k` is the index of the pair's first item; it advances
  /// to the next pair's.
  HWY_INLINE void choose_nearest(const Items& items, std::size_t& k, std::size_t i) {
    std::size_t best = k;
    float least_inside = items.inside[k];
    for (++k; k < items.count && Item{items.item[k]}.pair() == i; ++k) {
      best = items.square[k] < items.square[best] ? k : best;
      least_inside = std::min(least_inside, items.inside[k]);
    }
    over_face_[i] = least_inside >= -RoundPair<float, segment>::rounding_part * size_[i] ? ~0u : 0;
    part_[i] = items.part[best];
    for (int c = 0; c < 3; ++c) gap_[c][i] = items.gap[c][best];
  }

  /// Computes depth and point from the nearest points of core and hull, if these are verified to be the nearest.
  void compute_contacts() {
    alignas(64) Column hull_support = {}, apart, distance, depth;
    alignas(64) Column3 outward;
    for (std::size_t i = 0; i < block_pairs; i += lanes) {
      const hn::RebindToUnsigned<D> bits;
      const auto over = hn::MaskFromVec(hn::BitCast(d, hn::Load(bits, over_face_ + i)));
      const Vector<D> plane = load(d, outward_, i);
      const V height = hn::Load(d, separation_ + i), radius = hn::Load(d, radius_ + i);
      const Vector<D> gap = choose(d, over, negate(d, scale(d, plane, height)), load(d, gap_, i));
      Vector<D> nearest = load(d, start(), i), from = nearest;
      if constexpr (segment) {
        const Vector<D> axis = load(d, axis_, i);
        const V whole = hn::Load(d, length_ + i);
        const V end = hn::IfThenElseZero(hn::Lt(dot(d, plane, axis), hn::Zero(d)), whole);
        nearest = add(d, from, scale(d, axis, hn::IfThenElse(over, end, hn::Load(d, part_ + i))));
      }
      const V square = dot(d, gap, gap);
      const auto some = hn::Gt(square, hn::Set(d, 1e-30f));
      const V length = hn::Sqrt(hn::IfThenElse(some, square, hn::Set(d, 1.0f)));
      const Vector<D> normal = scale(d, gap, hn::Set(d, 1.0f) / length);
      const V its_distance = hn::IfThenElse(over, height, hn::IfThenElseZero(some, length));
      const V its_depth = radius - its_distance;
      const Vector<D> out = negate(d, normal);
      V core_support = dot(d, out, from);
      if constexpr (segment) core_support = hn::Min(core_support, dot(d, out, load(d, to_, i)));
      // From the core's nearest point towards the hull's: the surfaces are at the distances `radius` and `distance`.
      const Vector<D> point = add(d, subtract(d, nearest, load(d, centre_, i)),
                                  scale(d, normal, (radius + its_distance) * hn::Set(d, 0.5f)));
      const auto keep = hn::MaskFromVec(hn::BitCast(d, hn::Load(bits, found_.hit + i)));
      hn::Store(hn::IfThenElse(keep, hn::Load(d, found_.depth + i), its_depth), d, found_.depth + i);
      store(d, choose(d, keep, load(d, found_.normal, i), normal), found_.normal, i);
      store(d, choose(d, keep, load(d, found_.point, i), point), found_.point, i);
      store(d, out, outward, i);
      hn::Store(core_support, d, apart + i);
      hn::Store(its_distance, d, distance + i);
      hn::Store(its_depth, d, depth + i);
    }
    for (std::size_t u = 0; u < outside_.count; ++u) {
      const std::size_t i = outside_.pair[u];
      const geometry::Hull& hull = *hull_[i];
      hull_support[i] = support<float>(polytope_of(hull), at(outward, i));
      work_.pass<float>(hull.vertex_count());
    }
    for (std::size_t u = 0; u < outside_.count; ++u) {
      const std::size_t i = outside_.pair[u];
      // The overlap along the normal: never less than the depth, and equal to it if the normal is right.
      const float overlap = radius_[i] - (apart[i] - hull_support[i]);
      const bool over = over_face_[i] != 0;
      const bool sure = over || (overlap <= depth[i] + nearest_margin * size_[i] && depth[i] >= 0 &&
                                 distance[i] > RoundPair<float, segment>::rounding_part * size_[i]);
      const bool separated = !over && overlap < 0;
      found_.hit[i] = sure && !separated ? ~0u : 0;
      fallback_mask_ |= static_cast<std::uint32_t>(!sure && !separated) << i;
    }
    for (std::uint32_t rest = fallback_mask_; rest != 0; rest &= rest - 1) {
      test_single_pair(static_cast<std::size_t>(__builtin_ctz(rest)));
    }
  }

  /// Part of the sizes by which the distance of the two points may exceed that of the shapes.
  static constexpr float nearest_margin = 3e-7f;

  HWY_NOINLINE void test_single_pair(std::size_t i) {
    found_.hit[i] = 0;
    if (test_exhaustively<float>(i) == Decision::undecided) test_exhaustively<double>(i);
  }
  template <class T>
  Decision test_exhaustively(std::size_t i) {
    const Body& round = input_.bodies[pairs_[i].first];
    const RoundPlacement<T> placed(round.pose, input_.bodies[pairs_[i].second].pose,
                                   segment ? input_.shapes.row(round.shape).size[1] : 0.0f);
    const Polytope hull = polytope_of(*hull_[i]);
    RoundPair<T, segment> core(hull, placed.from, placed.to, T(radius_[i]));
    Overlap<T> found;
    const Decision decision = core.test(found);
    const WorkCounts work = core.work();
    work_.lanes += work.lanes;
    work_.filled += work.filled;
    work_.directions += work.directions;
    if (decision == Decision::contact) {
      const auto in_float = [](Point<T> p) {
        return Vec3f{static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
      };
      found_.put(i, static_cast<float>(found.depth), in_float(found.normal), in_float(found.point - placed.centre));
    }
    return decision;
  }

  /// Converts to world axes, relative to the round body's position.
  PairContact* write_found(PairContact* out) const {
    for (std::size_t i = 0; i < count_; i += lanes) {
      Rotation<D> to_world;
      for (int k = 0; k < 3; ++k) {
        for (int j = 0; j < 3; ++j) to_world.m[k][j] = hn::Load(d, rotation_[k][j] + i);
      }
      const hn::RebindToUnsigned<D> bits;
      const auto hit = hn::MaskFromVec(hn::BitCast(d, hn::Load(bits, found_.hit + i)));
      const LaneContacts<D> world{hit, hn::Load(d, found_.depth + i), rotate(d, to_world, load(d, found_.normal, i)),
                                  rotate(d, to_world, load(d, found_.point, i))};
      out = write<Kinds>(d, ids_of(d, pairs_ + i), std::min(count_ - i, lanes), world, load(d, offset_, i), out);
    }
    return out;
  }

  const KernelInput& input_;
  const std::size_t count_;
  WorkCounts& work_;
  KernelPair pairs_[block_pairs];
  const geometry::Hull* hull_[block_pairs];
  Undecided outside_;                // pairs whose core is outside the hull, and that no plane separates
  std::uint32_t fallback_mask_ = 0;  // one bit per pair that is left to the test of single pairs
  // The hull's axes in the world, and the vector from the round body's position to the hull's, in world axes.
  alignas(64) float rotation_[3][3][block_pairs];
  alignas(64) Column3 offset_;
  // The core: its centre, its ends and its direction.
  alignas(64) Column3 centre_, from_, to_, axis_;
  alignas(64) Column length_, radius_;
  alignas(64) Column size_;  // size of the hull plus the distance to the core
  alignas(64) Column separation_ = {};
  alignas(64) Column3 outward_ = {};  // normal of the farthest face
  std::uint32_t face_[block_pairs];
  // The data that the lanes of edges read: the start of the core, the normal of the farthest face, direction and length
  // of the core.
  alignas(64) float rows_[block_pairs][3][4];
  alignas(64) std::uint32_t over_face_[block_pairs] = {};  // all bits set or none
  alignas(64) Column part_ = {};                           // position of the nearest point along the core
  alignas(64) Column3 gap_ = {};                           // from there to the nearest point of the hull
  BlockContacts found_;                                    // relative to the round body's position
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
