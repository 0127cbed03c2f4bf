// One byte for each face of a polytope, with the results of tests. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_FACE_BYTES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_FACE_BYTES_INL
#undef RINGFENCE_NARROW_PHASE_FACE_BYTES_INL
#else
#define RINGFENCE_NARROW_PHASE_FACE_BYTES_INL
#endif

#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/polytope_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// One byte for each of the faces of four vectors, one bit per test. Stored as a whole, so that a load of a whole table
/// does not wait for several stores.
class FaceBytes {
 public:
  using D = Columns16<float>;
  static constexpr std::size_t lanes = hn::MaxLanes(D());
  static constexpr std::size_t faces = 4 * lanes;

  HWY_INLINE FaceBytes() : words_(hn::Zero(ints)) {}

  /// Sets a bit of the faces of the `vector`-th vector. Both numbers should be constants.
  HWY_INLINE void set(int vector, int bit, hn::Mask<D> mask) {
    const auto added = hn::IfThenElseZero(hn::RebindMask(ints, mask), hn::Set(ints, 1u << (8 * vector + bit)));
    words_ = hn::Or(words_, added);
  }

  /// Writes the bytes in the order of the faces.
  HWY_INLINE void store(std::uint8_t* to) const { hn::StoreU(in_order(), ints, reinterpret_cast<std::uint32_t*>(to)); }
  /// Sets these bits in bytes that another object of this class has written.
  HWY_INLINE void add_to(std::uint8_t* to) const {
    std::uint32_t* const words = reinterpret_cast<std::uint32_t*>(to);
    hn::StoreU(hn::Or(in_order(), hn::LoadU(ints, words)), ints, words);
  }

 private:
  using Ints = hn::RebindToUnsigned<D>;
  static constexpr Ints ints{};

  HWY_INLINE hn::Vec<Ints> in_order() const {
    auto words = words_;
#if HWY_TARGET != HWY_SCALAR
    // Byte v of lane i belongs to face v * lanes + i. First in blocks of four lanes, then across blocks.
    alignas(16) static constexpr std::uint8_t in_block[16] = {0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15};
    const hn::Repartition<std::uint8_t, Ints> bytes;
    words = hn::BitCast(ints, hn::TableLookupBytes(hn::BitCast(bytes, words), hn::LoadDup128(bytes, in_block)));
    if constexpr (lanes > 4) {
      alignas(64) std::int32_t order[lanes];
      for (std::size_t i = 0; i < lanes; ++i)
        order[i] = static_cast<std::int32_t>(i % (lanes / 4) * 4 + i / (lanes / 4));
      words = hn::TableLookupLanes(words, hn::SetTableIndices(ints, order));
    }
#endif
    return words;
  }

  hn::Vec<Ints> words_;
};

/// Calls `set(bytes, vector, f)` for each vector of faces from f on, and `store(bytes, f)` for each full FaceBytes.
template <class Set, class Store>
HWY_INLINE void for_face_bytes(std::size_t faces, const Set& set, const Store& store) {
  constexpr std::size_t lanes = FaceBytes::lanes;
  for (std::size_t f = 0; f < faces; f += FaceBytes::faces) {
    FaceBytes bytes;
    set(bytes, 0, f);
    if (f + lanes < faces) set(bytes, 1, f + lanes);
    if (f + 2 * lanes < faces) set(bytes, 2, f + 2 * lanes);
    if (f + 3 * lanes < faces) set(bytes, 3, f + 3 * lanes);
    store(bytes, f);
  }
}

/// For each face of a hull sets bit k if point k is at least depth[k] below the face: the three points and depths of
/// the other shape that exclude edges. `store` as above.
template <class Store>
HWY_INLINE void mark_deep_points(const geometry::Hull& hull, const Vec3f (&point)[3], const float (&depth)[3],
                                 const Store& store) {
  const FaceBytes::D d;
  const auto p = spread_out(d, point[0]), q = spread_out(d, point[1]), r = spread_out(d, point[2]);
  const auto of_p = hn::Set(d, depth[0]), of_q = hn::Set(d, depth[1]), of_r = hn::Set(d, depth[2]);
  const float *const x = hull.normal_x(), *const y = hull.normal_y(), *const z = hull.normal_z(),
                     *const offset = hull.offset();
  const auto mark = [&](FaceBytes& bytes, int vector, std::size_t f) HWY_ATTR {
    const auto normal = read(d, x + f, y + f, z + f);
    const auto height = hn::Load(d, offset + f);
    bytes.set(vector, 0, hn::Ge(height - dot_of(d, normal, p), of_p));
    bytes.set(vector, 1, hn::Ge(height - dot_of(d, normal, q), of_q));
    bytes.set(vector, 2, hn::Ge(height - dot_of(d, normal, r), of_r));
  };
  for_face_bytes(hull.face_count(), mark, store);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
