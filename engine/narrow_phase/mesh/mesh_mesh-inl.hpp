// Walks two mesh trees at once, sixteen pairs of boxes or triangles per step. Included once for each Highway target.
//
// All boxes of a mesh have the same axes, so all pairs share one rotation and the values derived from it. Each pair of
// boxes is a test of oriented boxes (Gottschalk, Lin and Manocha, "OBBTree", 1996) that costs a few products. A step
// takes the four children of one node of each tree: lane 4 i + j holds child i of the first node and child j of the
// second. As for convex shapes, the lanes only exclude pairs; the remaining ones are evaluated in double
// (mesh_walk-inl.hpp).

#if defined(RINGFENCE_NARROW_PHASE_MESH_MESH_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_MESH_MESH_INL
#undef RINGFENCE_NARROW_PHASE_MESH_MESH_INL
#else
#define RINGFENCE_NARROW_PHASE_MESH_MESH_INL
#endif

#include "narrow_phase/mesh/mesh_convex-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

class MeshPairWalk {
 public:
  /// `frame` places the second mesh in the axes of the first.
  MeshPairWalk(const geometry::MeshTree& first, const geometry::MeshTree& second, const MeshFrame& frame, double margin)
      : first_(first), second_(second), frame_(frame), deepest_(margin) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        rotation_.m[i][j] = at(d, frame.rotation.m[i][j]);
        spread_.m[i][j] = hn::Abs(rotation_.m[i][j]);
      }
    }
    offset_ = spread_out(d, frame.position);
  }

  /// Returns whether the meshes touch; then deepest() and the two triangles describe the contact.
  bool run() {
    const geometry::TreeNode p = first_.root(), q = second_.root();
    open_[count_++] = {p.level, p.index, q.level, q.index, std::numeric_limits<float>::infinity()};
    while (count_ > 0) {
      const OpenPair& last = open_[--count_];
      if (last.bound < deepest_.floor()) continue;
      const Pair next{{last.level_p, last.p}, {last.level_q, last.q}};
      if (next.p.level == 0 && next.q.level == 0) {
        test_leaves(first_.leaf(next.p.index), second_.leaf(next.q.index));
      } else {
        open_children(next);
      }
    }
    return deepest_.found();
  }

  const Deepest& deepest() const { return deepest_; }
  const Triangle& triangle() const { return triangle_; }
  /// In the axes of the first mesh.
  const Triangle& other_triangle() const { return other_triangle_; }
  const WalkCounts& work() const { return work_; }

 private:
  static constexpr FloatLanes d{};
  using Lanes = hn::Vec<FloatLanes>;

  struct Pair {
    geometry::TreeNode p, q;
  };
  /// A pair of nodes that waits, and its bound. Not initialised, because most of the stack is never used.
  struct OpenPair {
    std::uint32_t level_p, p, level_q, q;
    float bound;
  };

  /// The vector that starts at `lane`, where lane 4 i + j holds column[i].
  static HWY_INLINE Lanes by_row(const float* column, std::size_t lane) {
#if HWY_TARGET == HWY_SCALAR
    return hn::Set(d, column[lane / 4]);
#else
    alignas(64) static constexpr std::uint8_t bytes[64] = {
        0, 1, 2,  3,  0,  1,  2,  3,  0,  1,  2,  3,  0,  1,  2,  3,  4,  5,  6,  7, 4,  5,
        6, 7, 4,  5,  6,  7,  4,  5,  6,  7,  8,  9,  10, 11, 8,  9,  10, 11, 8,  9, 10, 11,
        8, 9, 10, 11, 12, 13, 14, 15, 12, 13, 14, 15, 12, 13, 14, 15, 12, 13, 14, 15};
    const hn::Repartition<std::uint8_t, FloatLanes> b;
    const auto column4 = hn::BitCast(b, hn::LoadDup128(d, column));
    return hn::BitCast(d, hn::TableLookupBytes(column4, hn::Load(b, bytes + 4 * lane)));
#endif
  }
  /// The vector that starts at `lane`, where lane 4 i + j holds column[j].
  static HWY_INLINE Lanes by_column(const float* column, [[maybe_unused]] std::size_t lane) {
#if HWY_TARGET == HWY_SCALAR
    return hn::Set(d, column[lane % 4]);
#else
    return hn::LoadDup128(d, column);
#endif
  }

  static HWY_INLINE Vector<FloatLanes> by_row(const float (*columns)[4], std::size_t lane) {
    return {by_row(columns[0], lane), by_row(columns[1], lane), by_row(columns[2], lane)};
  }
  static HWY_INLINE Vector<FloatLanes> by_column(const float (*columns)[4], std::size_t lane) {
    return {by_column(columns[0], lane), by_column(columns[1], lane), by_column(columns[2], lane)};
  }

  static float size_of(const geometry::MeshTree& tree, geometry::TreeNode node) {
    const geometry::BoxGroup& group = tree.boxes_with(node);
    const std::size_t lane = node.index % 4;
    return group.half[0][lane] + group.half[1][lane] + group.half[2][lane];
  }

  /// Opens both nodes, or only one if the other is a leaf or less than half as large. The node that stays closed is
  /// tested with its siblings, in its own row or column.
  void open_children(const Pair& pair) {
    const float size_p = size_of(first_, pair.p), size_q = size_of(second_, pair.q);
    const bool keep_p = pair.p.level == 0 || (pair.q.level > 0 && size_q > 2 * size_p);
    const bool keep_q = pair.q.level == 0 || (pair.p.level > 0 && size_p > 2 * size_q);
    const std::uint32_t level_p = pair.p.level - (keep_p ? 0 : 1), level_q = pair.q.level - (keep_q ? 0 : 1);
    const std::uint32_t group_p = keep_p ? pair.p.index / 4 : pair.p.index;
    const std::uint32_t group_q = keep_q ? pair.q.index / 4 : pair.q.index;
    work_.pass(group_size,
               (keep_p ? 1 : nodes_of(first_, level_p, group_p)) * (keep_q ? 1 : nodes_of(second_, level_q, group_q)));
    ++work_.evaluated;
    BoundedLanes children = test_boxes(first_.boxes(level_p, group_p), second_.boxes(level_q, group_q));
    if (keep_p) children.bits &= 0xfu << 4 * (pair.p.index % 4);
    if (keep_q) children.bits &= 0x1111u << pair.q.index % 4;
    count_ += static_cast<std::size_t>(__builtin_popcount(children.bits));
    assert(count_ <= std::size(open_));
    // The pair with the largest bound is on top of the stack.
    for (OpenPair* to = open_ + count_; children.bits != 0;) {
      const std::uint32_t lane = children.take_largest();
      *--to = {level_p, group_p * 4 + lane / 4, level_q, group_q * 4 + lane % 4, children.bound[lane]};
    }
  }

  /// The least overlap of each pair along the axes of the two meshes. It is an upper bound of the depth of all
  /// primitives inside.
  BoundedLanes test_boxes(const geometry::BoxGroup& p, const geometry::BoxGroup& q) const {
    BoundedLanes result;
    for (std::size_t lane = 0; lane < group_size; lane += hn::Lanes(d)) {
      const Vector<FloatLanes> centre_q = add(d, rotate(d, rotation_, by_column(q.centre, lane)), offset_);
      const Vector<FloatLanes> half_q = by_column(q.half, lane);
      const Vector<FloatLanes> spread_q = rotate(d, spread_, half_q);
      const Vector<FloatLanes> half_p = by_row(p.half, lane);
      const Vector<FloatLanes> apart = subtract(d, centre_q, by_row(p.centre, lane));
      const Vector<FloatLanes> of_p = subtract(d, add(d, half_p, spread_q), absolute(apart));
      const Vector<FloatLanes> of_q =
          subtract(d, add(d, half_q, unrotate(d, spread_, half_p)), absolute(unrotate(d, rotation_, apart)));
      const auto least = hn::Min(hn::Min(hn::Min(of_p.x, of_p.y), hn::Min(of_p.z, of_q.x)), hn::Min(of_q.y, of_q.z));
      result.put(d, lane, least, deepest_.floor());
    }
    return result;
  }

  static HWY_INLINE Vector<FloatLanes> absolute(const Vector<FloatLanes>& v) {
    return {hn::Abs(v.x), hn::Abs(v.y), hn::Abs(v.z)};
  }

  void test_leaves(const geometry::TriangleGroup& p, const geometry::TriangleGroup& q) {
    const std::size_t in_p = triangles_of(p), in_q = triangles_of(q);
    work_.pass(group_size, in_p * in_q);
    ++work_.evaluated;
    BoundedLanes pairs;
    for (std::size_t lane = 0; lane < group_size; lane += hn::Lanes(d)) {
      // The triangles of the second mesh in the axes of the first.
      Vector<FloatLanes> corner_p[3], corner_q[3];
      for (int c = 0; c < 3; ++c) {
        corner_p[c] = by_row(p.corner[c], lane);
        corner_q[c] = add(d, rotate(d, rotation_, by_column(q.corner[c], lane)), offset_);
      }
      const Vector<FloatLanes> normal_p = by_row(p.normal, lane);
      const Vector<FloatLanes> normal_q = rotate(d, rotation_, by_column(q.normal, lane));
      pairs.put(d, lane, bound_triangles(corner_p, normal_p, corner_q, normal_q), deepest_.floor());
    }
    // Excludes rows and columns that repeat the last triangle.
    pairs.bits &= ((1u << in_q) - 1) * (0x1111u & ((1u << 4 * in_p) - 1));
    while (pairs.bits != 0) {
      const std::uint32_t lane = pairs.take_largest();
      if (pairs.bound[lane] < deepest_.floor()) return;
      consider(p, lane / 4, q, lane % 4);
    }
  }

  void consider(const geometry::TriangleGroup& p, std::size_t lane_p, const geometry::TriangleGroup& q,
                std::size_t lane_q) {
    ++work_.evaluated;
    const Triangle triangle = triangle_of(p, lane_p);
    Triangle other = triangle_of(q, lane_q);
    for (Vec3d& corner : other.corner) corner = frame_.to_mesh(corner);
    const Penetration penetration = triangle_penetration(triangle, other, deepest_.at_least());
    if (deepest_.take(penetration, std::uint64_t{p.index[lane_p]} << 32 | q.index[lane_q])) {
      triangle_ = triangle;
      other_triangle_ = other;
    }
  }

  /// The separating axis test of triangles that are not coplanar, by the two normals and the nine cross products of
  /// edges.
  HWY_INLINE Lanes bound_triangles(const Vector<FloatLanes>* p, const Vector<FloatLanes>& normal_p,
                                   const Vector<FloatLanes>* q, const Vector<FloatLanes>& normal_q) const {
    const auto zero = hn::Zero(d);
    Vector<FloatLanes> to_q[3], to_p[3];
    for (int i = 0; i < 3; ++i) to_q[i] = subtract(d, q[i], p[0]);
    const auto height_q =
        Span<FloatLanes>::of(dot(d, normal_p, to_q[0]), dot(d, normal_p, to_q[1]), dot(d, normal_p, to_q[2]));
    for (int i = 0; i < 3; ++i) to_p[i] = subtract(d, p[i], q[0]);
    const auto height_p =
        Span<FloatLanes>::of(dot(d, normal_q, to_p[0]), dot(d, normal_q, to_p[1]), dot(d, normal_q, to_p[2]));
    auto bound = hn::Min(height_q.overlap(zero), height_p.overlap(zero));
    if (hn::AllTrue(d, bound < hn::Set(d, deepest_.floor()))) return bound;

    Vector<FloatLanes> edge_p[3], edge_q[3];
    Lanes squared_p[3], squared_q[3];
    for (int i = 0; i < 3; ++i) {
      edge_p[i] = subtract(d, p[next_of(i)], p[i]);
      edge_q[i] = subtract(d, q[next_of(i)], q[i]);
      // If the edges are parallel within 0.1, the axis is too imprecise to exclude anything.
      squared_p[i] = dot(d, edge_p[i], edge_p[i]) * hn::Set(d, 0.01f);
      squared_q[i] = dot(d, edge_q[i], edge_q[i]);
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const Vector<FloatLanes> axis = cross(d, edge_p[i], edge_q[j]);
        // Two corners of each triangle are at the height of its edge; only the opposite corner differs. Relative to
        // p[i].
        const auto q_edge = dot(d, axis, subtract(d, q[j], p[i]));
        const auto q_opposite = q_edge + dot(d, axis, subtract(d, q[next_of(next_of(j))], q[j]));
        const auto p_opposite = dot(d, axis, subtract(d, p[next_of(next_of(i))], p[i]));
        const auto span_p = Span<FloatLanes>::of(zero, p_opposite), span_q = Span<FloatLanes>::of(q_edge, q_opposite);
        const auto shared = hn::Min(span_p.high - span_q.low, span_q.high - span_p.low);
        const auto squared = dot(d, axis, axis);
        const auto precise = squared > squared_p[i] * squared_q[j];
        bound = hn::IfThenElse(precise, hn::Min(bound, shared / hn::Sqrt(squared)), bound);
      }
    }
    return bound;
  }

  const geometry::MeshTree& first_;
  const geometry::MeshTree& second_;
  const MeshFrame& frame_;
  Rotation<FloatLanes> rotation_, spread_;
  Vector<FloatLanes> offset_;
  Deepest deepest_;
  WalkCounts work_;
  Triangle triangle_, other_triangle_;
  OpenPair open_[15 * 2 * geometry::max_tree_levels + 16];
  std::size_t count_ = 0;
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
