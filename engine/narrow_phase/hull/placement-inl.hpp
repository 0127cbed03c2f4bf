// Placements: the second polytope of a pair in the axes of the first, for a vector of pairs at a time, and the line
// between their centres, along which most separated pairs are separated. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_PLACEMENT_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PLACEMENT_INL
#undef RINGFENCE_NARROW_PHASE_PLACEMENT_INL
#else
#define RINGFENCE_NARROW_PHASE_PLACEMENT_INL
#endif

#include <algorithm>
#include <cstddef>

#include "narrow_phase/hull/polytope_lanes-inl.hpp"
#include "narrow_phase/simd/pair_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The second body relative to the first.
template <class T>
struct Placement {
  RotationMatrix<T> first;            ///< from the axes of the first to the world's
  RotationMatrix<T> second_to_first;  ///< from the axes of the second to those of the first
  Point<T> offset;                    ///< from the first's origin to the second's, in the axes of the first
  Point<T> world;                     ///< the same in world axes
  Point<T> axis;                      ///< from centre to centre, not unit; in the axes of the first
  Point<T> axis_in_second;
  T axis_squared;
};

/// Computes a placement in double. The centres are in the axes of their shapes.
inline Placement<double> placement_of(const Pose& p, Vec3f p_centre, const Pose& q, Vec3f q_centre) {
  Placement<double> out;
  out.first = geometry::rotation_exact(p.orientation);
  out.world = q.position - p.position;
  const geometry::RotationD second = geometry::rotation_exact(q.orientation);
  for (int k = 0; k < 3; ++k) {
    const Vec3d axis = rotate_inverse(out.first, Vec3d{second.m[0][k], second.m[1][k], second.m[2][k]});
    out.second_to_first.m[0][k] = axis.x;
    out.second_to_first.m[1][k] = axis.y;
    out.second_to_first.m[2][k] = axis.z;
  }
  out.offset = rotate_inverse(out.first, out.world);
  out.axis = (rotate(out.second_to_first, to_double(q_centre)) + out.offset) - to_double(p_centre);
  out.axis_squared = dot(out.axis, out.axis);
  if (!(out.axis_squared > 1e-20)) {
    out.axis = {1, 0, 0};
    out.axis_squared = 1;
  }
  out.axis_in_second = rotate_inverse(out.second_to_first, out.axis);
  return out;
}

/// Whether the centre of this kind of shape is its origin, as for a box. The centre of a hull is stored in the sizes of
/// its row.
template <ShapeKind kind>
constexpr bool centred = kind == ShapeKind::box;

/// Placements of some pairs as columns of floats.
class PlacementColumns {
 public:
  static constexpr std::size_t most = 16;

  /// Reads up to `most` pairs of two kinds with the narrowest vectors that hold them. Returns how many.
  template <ShapeKind first, ShapeKind second>
  std::size_t fill(const KernelInput& input, const KernelPair* pairs, std::size_t count) {
    const hn::CappedTag<float, 16> full;
    const hn::CappedTag<float, 4> quarter;
    const std::size_t taken = std::min(count, most);
    if (taken > 8) {
      place<first, second>(full, input, pairs, taken);
    } else {
      place<first, second>(quarter, input, pairs, taken);
    }
    return taken;
  }

  HWY_INLINE Placement<float> get(std::size_t i) const {
    Placement<float> p;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) {
        p.first.m[k][j] = first_[k][j][i];
        p.second_to_first.m[k][j] = second_to_first_[k][j][i];
      }
    }
    p.offset = at(offset_, i);
    p.world = at(world_, i);
    p.axis = at(axis_, i);
    p.axis_in_second = at(axis_in_second_, i);
    p.axis_squared = axis_squared_[i];
    return p;
  }

  /// Columns of `most` floats, one per pair; see Placement.
  const float* first(int row, int column) const { return first_[row][column]; }
  const float* second_to_first(int row, int column) const { return second_to_first_[row][column]; }
  const float* offset(int k) const { return offset_[k]; }
  const float* world(int k) const { return world_[k]; }
  const float* axis(int k) const { return axis_[k]; }
  const float* along_axis() const { return along_axis_; }
  const float* axis_squared() const { return axis_squared_; }
  /// ShapeRow::size of the first and the second shape.
  const float* first_size(int k) const { return first_size_[k]; }
  const float* second_size(int k) const { return second_size_[k]; }

  // Of pairs from i on, one per lane, or of pair i: Placement::offset, and the rotation from the axes of the second
  // shape to those of the first.
  template <class D>
  HWY_INLINE Vector<D> offset_lanes(D d, std::size_t i) const {
    return {hn::LoadU(d, offset_[0] + i), hn::LoadU(d, offset_[1] + i), hn::LoadU(d, offset_[2] + i)};
  }
  HWY_INLINE Vec3f offset_of(std::size_t i) const { return at(offset_, i); }
  template <class D>
  HWY_INLINE Rotation<D> rotation_lanes(D d, std::size_t i) const {
    Rotation<D> r;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) r.m[k][j] = hn::LoadU(d, second_to_first_[k][j] + i);
    }
    return r;
  }
  HWY_INLINE RotationMatrix<float> rotation_of(std::size_t i) const {
    RotationMatrix<float> r;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) r.m[k][j] = second_to_first_[k][j][i];
    }
    return r;
  }

  HWY_INLINE Vec3f axis(std::size_t i) const { return at(axis_, i); }
  HWY_INLINE Vec3f axis_in_second(std::size_t i) const { return at(axis_in_second_, i); }
  /// axis · offset: the shapes are apart if the sum of their supports along the axis is less than this.
  HWY_INLINE float along_axis(std::size_t i) const { return along_axis_[i]; }

 private:
  template <ShapeKind a, ShapeKind b>
  struct Kinds {
    static constexpr ShapeKind first = a, second = b;
  };
  using Column3 = float[3][most];

  static HWY_INLINE Vec3f at(const Column3& columns, std::size_t i) {
    return {columns[0][i], columns[1][i], columns[2][i]};
  }
  template <class D>
  static HWY_INLINE void put(D d, const Vector<D>& v, Column3& columns, std::size_t i) {
    hn::StoreU(v.x, d, columns[0] + i);
    hn::StoreU(v.y, d, columns[1] + i);
    hn::StoreU(v.z, d, columns[2] + i);
  }
  template <class D>
  static HWY_INLINE void put(D d, const Rotation<D>& r, float (&columns)[3][3][most], std::size_t i) {
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) hn::StoreU(r.m[k][j], d, columns[k][j] + i);
    }
  }

  template <ShapeKind first, ShapeKind second, class D>
  HWY_INLINE void place(D d, const KernelInput& input, const KernelPair* pairs, std::size_t count) {
    constexpr std::size_t lanes = hn::MaxLanes(D());
    using Both = Kinds<first, second>;
    for (std::size_t i = 0; i < count; i += lanes) {
      if (count - i >= lanes) {
        place_vector<first, second>(d, gather<Both>(d, input, AdjacentPairs<KernelPair>{pairs + i}), i);
      } else {
        KernelPair padded[lanes];
        std::fill(std::copy(pairs + i, pairs + count, padded), padded + lanes, pairs[count - 1]);
        place_vector<first, second>(d, gather<Both>(d, input, AdjacentPairs<KernelPair>{padded}), i);
      }
    }
  }

  template <ShapeKind first, ShapeKind second, class D>
  HWY_INLINE void place_vector(D d, const Lanes<D>& in, std::size_t i) {
    const Rotation<D> p = rotation(d, in.first_orientation), q = rotation(d, in.second_orientation);
    Rotation<D> second_to_first;
    for (int k = 0; k < 3; ++k) {
      const Vector<D> axis = unrotate(d, p, column(q, k));
      second_to_first.m[0][k] = axis.x;
      second_to_first.m[1][k] = axis.y;
      second_to_first.m[2][k] = axis.z;
    }
    const Vector<D> offset = unrotate(d, p, in.offset);
    Vector<D> axis = offset;
    if constexpr (!centred<second>) axis = add(d, rotate(d, second_to_first, in.second_size), axis);
    if constexpr (!centred<first>) axis = subtract(d, axis, in.first_size);
    auto squared = dot(d, axis, axis);
    const auto apart = squared > hn::Set(d, 1e-20f);
    const auto one = hn::Set(d, 1.0f), zero = hn::Zero(d);
    axis = choose(d, apart, axis, Vector<D>{one, zero, zero});
    squared = hn::IfThenElse(apart, squared, one);
    put(d, p, first_, i);
    put(d, second_to_first, second_to_first_, i);
    put(d, offset, offset_, i);
    put(d, in.offset, world_, i);
    put(d, in.first_size, first_size_, i);
    put(d, in.second_size, second_size_, i);
    put(d, axis, axis_, i);
    put(d, unrotate(d, second_to_first, axis), axis_in_second_, i);
    hn::StoreU(squared, d, axis_squared_ + i);
    hn::StoreU(dot(d, axis, offset), d, along_axis_ + i);
  }

  alignas(64) float first_[3][3][most];
  float second_to_first_[3][3][most];
  Column3 offset_, world_, axis_, axis_in_second_, first_size_, second_size_;
  float axis_squared_[most], along_axis_[most];
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
