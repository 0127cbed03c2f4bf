// Shared by all closed-form kernels: gathers candidate pairs into lanes and writes contacts. Included once for each
// Highway target.
//
// A block of pairs is gathered from rows of 48 and 32 bytes. Each row is copied with 16-byte loads into rows of the
// block, and four such rows become four vectors by in-register transposes. Contacts of 32 bytes are written without a
// branch.
//
// A kernel is a struct with the two kinds and `static LaneContacts<D> test(D, const Lanes<D>&)`, for D of float and of
// double.

#if defined(RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL
#undef RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL
#else
#define RINGFENCE_NARROW_PHASE_PAIR_BLOCK_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "geometry/rows-inl.hpp"
#include "narrow_phase/kernel.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The input of a kernel in lanes. Only the fields that the kinds need are filled: a sphere has no orientation.
template <class D>
struct Lanes {
  Vector<D> offset;  ///< from the first body's position to the second's, metres
  Quaternion<D> first_orientation, second_orientation;
  Vector<D> first_size, second_size;  ///< as in ShapeRow::size
};

constexpr bool has_orientation(ShapeKind kind) { return kind != ShapeKind::sphere; }

/// Number of vectors that are gathered before the first is computed. By then the 16-byte stores have left the store
/// buffer; the wide loads could not be forwarded from it.
inline constexpr std::size_t group = 4;

/// The rows of one vector of pairs, [row within four][column]: lane 4 b + r is in row r, columns 4 b to 4 b + 3.
template <std::size_t lanes>
struct Rows {
  alignas(64) float at[4][std::max<std::size_t>(lanes, 4)];

  float* of(std::size_t lane) { return &at[lane % 4][lane / 4 * 4]; }
};

#if HWY_TARGET == HWY_SCALAR

template <class D>
HWY_INLINE void load_rows(D d, const Rows<1>& rows, hn::Vec<D>* out) {
  for (int k = 0; k < 4; ++k) out[k] = hn::Load(d, &rows.at[0][k]);
}

template <class D>
HWY_INLINE void store_rows(D d, hn::Vec<D> a, hn::Vec<D> b, hn::Vec<D> c, hn::Vec<D> e, Rows<1>& rows) {
  const hn::Vec<D> in[4] = {a, b, c, e};
  for (int k = 0; k < 4; ++k) hn::Store(in[k], d, &rows.at[0][k]);
}

#else

using geometry::HWY_NAMESPACE::join_rows;
using geometry::HWY_NAMESPACE::transpose;

template <class D>
HWY_INLINE void load_rows(D d, const Rows<hn::MaxLanes(D())>& rows, hn::Vec<D>* out) {
  transpose(d, hn::Load(d, rows.at[0]), hn::Load(d, rows.at[1]), hn::Load(d, rows.at[2]), hn::Load(d, rows.at[3]), out);
}

template <class D>
HWY_INLINE void store_rows(D d, hn::Vec<D> a, hn::Vec<D> b, hn::Vec<D> c, hn::Vec<D> e, Rows<hn::MaxLanes(D())>& rows) {
  hn::Vec<D> out[4];
  transpose(d, a, b, c, e, out);
  for (int r = 0; r < 4; ++r) hn::Store(out[r], d, rows.at[r]);
}

#endif

using geometry::HWY_NAMESPACE::gather_rows;

HWY_INLINE void copy_row(const float* from, float* to) { std::memcpy(to, from, 4 * sizeof(float)); }

/// Writes second - first and, as the fourth float, `fourth`. The difference is computed in double, then rounded.
HWY_INLINE void write_offset(const Body& first, const Body& second, float fourth, float* to) {
#if HWY_MAX_BYTES >= 32
  // Reads eight bytes past z, which are still inside the body. They are masked before the conversion, which could be
  // slow for arbitrary bits.
  alignas(32) static constexpr std::uint64_t three[4] = {~0ull, ~0ull, ~0ull, 0};
  alignas(16) static constexpr std::uint32_t last[4] = {0, 0, 0, ~0u};
  const hn::FixedTag<double, 4> position;
  const hn::RebindToUnsigned<decltype(position)> position_bits;
  const hn::FixedTag<float, 4> row;
  const hn::RebindToUnsigned<decltype(row)> row_bits;
  const auto difference = hn::LoadU(position, &second.pose.position.x) - hn::LoadU(position, &first.pose.position.x);
  const auto masked = hn::And(difference, hn::BitCast(position, hn::Load(position_bits, three)));
  const auto extra = hn::And(hn::Set(row, fourth), hn::BitCast(row, hn::Load(row_bits, last)));
  hn::Store(hn::Or(hn::DemoteTo(row, masked), extra), row, to);
#else
  to[0] = static_cast<float>(second.pose.position.x - first.pose.position.x);
  to[1] = static_cast<float>(second.pose.position.y - first.pose.position.y);
  to[2] = static_cast<float>(second.pose.position.z - first.pose.position.z);
  to[3] = fourth;
#endif
}

/// The rows of one vector of pairs, for a kernel in float.
template <class K, std::size_t N>
struct Gathered {
  static constexpr bool first_is_sphere = K::first == ShapeKind::sphere;
  static constexpr bool second_is_sphere = K::second == ShapeKind::sphere;

  Rows<N> offset;  ///< the fourth float is the first body's radius if it is a sphere
  Rows<has_orientation(K::first) ? N : 4> first_orientation;
  Rows<has_orientation(K::second) ? N : 4> second_orientation;
  Rows<first_is_sphere ? 4 : N> first_size;
  Rows<second_is_sphere ? 4 : N> second_size;
  alignas(64) float second_radius[N];

  HWY_INLINE void fill(const KernelInput& input, const KernelPair* pairs) {
    const Body* bodies = input.bodies.data();
    const geometry::ShapeRow* rows = input.shapes.rows();
    fill_lanes(bodies, rows, pairs, std::make_index_sequence<N>());
  }

  /// Unrolled, so that the addresses of a lane's rows are known at compile time.
  template <std::size_t... lane>
  HWY_INLINE void fill_lanes(const Body* bodies, const geometry::ShapeRow* rows, const KernelPair* pairs,
                             std::index_sequence<lane...>) {
    (fill_lane(bodies, rows, pairs[lane], lane), ...);
  }

  HWY_INLINE void fill_lane(const Body* bodies, const geometry::ShapeRow* rows, const KernelPair& pair,
                            std::size_t lane) {
    const Body& first = bodies[pair.first];
    const Body& second = bodies[pair.second];
    const geometry::ShapeRow& first_row = rows[first.shape];
    const geometry::ShapeRow& second_row = rows[second.shape];
    write_offset(first, second, first_row.size[0], offset.of(lane));
    if constexpr (has_orientation(K::first)) copy_row(&first.pose.orientation.x, first_orientation.of(lane));
    if constexpr (has_orientation(K::second)) copy_row(&second.pose.orientation.x, second_orientation.of(lane));
    if constexpr (!first_is_sphere) copy_row(first_row.size, first_size.of(lane));
    if constexpr (second_is_sphere) {
      second_radius[lane] = second_row.size[0];
    } else {
      copy_row(second_row.size, second_size.of(lane));
    }
  }

  template <class D>
  HWY_INLINE Lanes<D> lanes(D d) const {
    Lanes<D> out;
    hn::Vec<D> v[4];
    load_rows(d, offset, v);
    out.offset = {v[0], v[1], v[2]};
    if constexpr (first_is_sphere) out.first_size.x = v[3];
    if constexpr (has_orientation(K::first)) {
      load_rows(d, first_orientation, v);
      out.first_orientation = {v[0], v[1], v[2], v[3]};
    }
    if constexpr (has_orientation(K::second)) {
      load_rows(d, second_orientation, v);
      out.second_orientation = {v[0], v[1], v[2], v[3]};
    }
    if constexpr (!first_is_sphere) {
      load_rows(d, first_size, v);
      out.first_size = {v[0], v[1], v[2]};
    }
    if constexpr (second_is_sphere) {
      out.second_size.x = hn::Load(d, second_radius);
    } else {
      load_rows(d, second_size, v);
      out.second_size = {v[0], v[1], v[2]};
    }
    return out;
  }
};

/// Whether the hits of a vector are compressed to its front before it is stored. Otherwise every lane is stored, and
/// the end advances past the lanes that hit. Measured for spheres: AVX-512 4.8 ns per pair against 5.1, SSE4 6.5
/// against 7.4; but AVX2, which emulates the missing instruction with tables, 16.5 against 6.2.
#if HWY_TARGET == HWY_AVX2
inline constexpr bool compress_hits = false;
#else
inline constexpr bool compress_hits = true;
#endif

template <class V, class M>
HWY_INLINE V to_front(V v, M hit) {
  if constexpr (compress_hits) {
    return hn::Compress(v, hit);
  } else {
    return v;
  }
}

/// Stores the contacts of the lanes that hit; `head` and `tail` are the two halves of each lane's contact.
template <class D>
HWY_INLINE PairContact* store_hits(D d, Rows<hn::MaxLanes(D())>& head, Rows<hn::MaxLanes(D())>& tail, hn::Mask<D> hit,
                                   PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  if constexpr (compress_hits) {
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      unsigned char* const to = reinterpret_cast<unsigned char*>(out + lane);
      std::memcpy(to, head.of(lane), 16);
      std::memcpy(to + 16, tail.of(lane), 16);
    }
    return out + hn::CountTrue(d, hit);
  } else {
    std::uint8_t bytes[8];
    hn::StoreMaskBits(d, hit, bytes);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      unsigned char* const to = reinterpret_cast<unsigned char*>(out);
      std::memcpy(to, head.of(lane), 16);
      std::memcpy(to + 16, tail.of(lane), 16);
      out += bytes[lane / 8] >> lane % 8 & 1;
    }
    return out;
  }
}

/// Writes the contacts of the lanes below `count` that hit. Zeros are written as +0, because targets differ in their
/// sign.
template <class K, class D>
HWY_INLINE PairContact* write(D d, const KernelPair* pairs, std::size_t count, const LaneContacts<D>& found,
                              const Vector<D>& offset, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const hn::RebindToUnsigned<D> ids;
  const auto zero = hn::Zero(d);
  hn::Vec<decltype(ids)> first, second, pair, flipped;
  hn::LoadInterleaved4(ids, &pairs->first, first, second, pair, flipped);
  Vector<D> normal = found.normal, point = found.point;
  if constexpr (K::first != K::second) {
    const auto flip = hn::BitCast(d, flipped);
    const auto sign = hn::BroadcastSignBit(hn::BitCast(hn::RebindToSigned<D>(), flipped));
    const auto flips = hn::MaskFromVec(hn::BitCast(d, sign));
    normal = {hn::Xor(normal.x, flip), hn::Xor(normal.y, flip), hn::Xor(normal.z, flip)};
    point = choose(d, flips, subtract(d, point, offset), point);
  }
  const hn::Mask<D> hit = count < lanes ? hn::And(found.hit, hn::FirstN(d, count)) : found.hit;
  Rows<lanes> head, tail;
  store_rows(d, to_front(hn::BitCast(d, pair), hit), to_front(hn::Max(found.depth, zero) + zero, hit),
             to_front(normal.x + zero, hit), to_front(normal.y + zero, hit), head);
  store_rows(d, to_front(normal.z + zero, hit), to_front(point.x + zero, hit), to_front(point.y + zero, hit),
             to_front(point.z + zero, hit), tail);
  return store_hits(d, head, tail, hit, out);
}

/// Tests `vectors` <= group full vectors of pairs.
template <class K, class D>
HWY_INLINE PairContact* run_group(D d, const KernelInput& input, const KernelPair* pairs, std::size_t vectors,
                                  PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  Gathered<K, lanes> gathered[group];
  begin_gathering(input);
  for (std::size_t v = 0; v < vectors; ++v) gathered[v].fill(input, pairs + v * lanes);
  end_gathering(input);
  for (std::size_t v = 0; v < vectors; ++v) {
    const Lanes<D> in = gathered[v].lanes(d);
    out = write<K>(d, pairs + v * lanes, lanes, K::test(d, in), in.offset, out);
  }
  return out;
}

/// Tests fewer pairs than a vector holds. The lanes after the last pair repeat it and are not written.
template <class K, class D>
PairContact* run_rest(D d, const KernelInput& input, const KernelPair* pairs, std::size_t count, PairContact* out) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  KernelPair padded[lanes];
  std::fill(std::copy_n(pairs, count, padded), padded + lanes, pairs[count - 1]);
  Gathered<K, lanes> gathered;
  begin_gathering(input);
  gathered.fill(input, padded);
  end_gathering(input);
  const Lanes<D> in = gathered.lanes(d);
  return write<K>(d, padded, count, K::test(d, in), in.offset, out);
}

/// Tests all pairs in float: full vectors first, then the narrowest vector that holds the rest.
template <class K>
PairContact* run_in_float(const KernelInput& input, PairContact* out, KindCounters& counters) {
  hn::CappedTag<float, 16> full;
  hn::CappedTag<float, 8> half;
  hn::CappedTag<float, 4> quarter;
  constexpr std::size_t lanes = hn::MaxLanes(full);
  const std::size_t size = input.pairs.size();
  const KernelPair* pairs = input.pairs.data();
  std::size_t begin = 0;
  while (size - begin >= lanes) {
    const std::size_t vectors = std::min((size - begin) / lanes, group);
    out = run_group<K>(full, input, pairs + begin, vectors, out);
    begin += vectors * lanes;
    counters.lanes += vectors * lanes;
  }
  const std::size_t rest = size - begin;
  if (rest == 0) return out;
  if (rest > hn::MaxLanes(half)) {
    counters.lanes += lanes;
    return run_rest<K>(full, input, pairs + begin, rest, out);
  }
  if (rest > hn::MaxLanes(quarter)) {
    counters.lanes += hn::MaxLanes(half);
    return run_rest<K>(half, input, pairs + begin, rest, out);
  }
  counters.lanes += hn::MaxLanes(quarter);
  return run_rest<K>(quarter, input, pairs + begin, rest, out);
}

/// Columns of pairs for the kernels in double. Such pairs are rare: they are gathered and written one by one.
template <std::size_t N>
struct Columns {
  alignas(64) double offset[3][N], first_orientation[4][N], second_orientation[4][N], first_size[3][N],
      second_size[3][N];

  void fill(const KernelInput& input, const KernelPair& pair, std::size_t lane) {
    const Body& first = input.bodies[pair.first];
    const Body& second = input.bodies[pair.second];
    const geometry::ShapeRow& first_row = input.shapes.row(first.shape);
    const geometry::ShapeRow& second_row = input.shapes.row(second.shape);
    offset[0][lane] = second.pose.position.x - first.pose.position.x;
    offset[1][lane] = second.pose.position.y - first.pose.position.y;
    offset[2][lane] = second.pose.position.z - first.pose.position.z;
    const Quat &p = first.pose.orientation, &q = second.pose.orientation;
    const float p_parts[4] = {p.x, p.y, p.z, p.w}, q_parts[4] = {q.x, q.y, q.z, q.w};
    for (std::size_t k = 0; k < 4; ++k) {
      first_orientation[k][lane] = static_cast<double>(p_parts[k]);
      second_orientation[k][lane] = static_cast<double>(q_parts[k]);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      first_size[k][lane] = static_cast<double>(first_row.size[k]);
      second_size[k][lane] = static_cast<double>(second_row.size[k]);
    }
  }

  template <class D>
  Lanes<D> lanes(D d) const {
    return {{hn::Load(d, offset[0]), hn::Load(d, offset[1]), hn::Load(d, offset[2])},
            {hn::Load(d, first_orientation[0]), hn::Load(d, first_orientation[1]), hn::Load(d, first_orientation[2]),
             hn::Load(d, first_orientation[3])},
            {hn::Load(d, second_orientation[0]), hn::Load(d, second_orientation[1]), hn::Load(d, second_orientation[2]),
             hn::Load(d, second_orientation[3])},
            {hn::Load(d, first_size[0]), hn::Load(d, first_size[1]), hn::Load(d, first_size[2])},
            {hn::Load(d, second_size[0]), hn::Load(d, second_size[1]), hn::Load(d, second_size[2])}};
  }
};

template <class K>
PairContact* run_in_double(const KernelInput& input, PairContact* out, KindCounters& counters) {
  using D = hn::CappedTag<double, 8>;
  const D d;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  Columns<lanes> columns;
  alignas(64) double found[7][lanes];
  for (std::size_t begin = 0; begin < input.pairs.size(); begin += lanes) {
    const std::size_t count = std::min(input.pairs.size() - begin, lanes);
    begin_gathering(input);
    for (std::size_t i = 0; i < lanes; ++i) columns.fill(input, input.pairs[begin + std::min(i, count - 1)], i);
    end_gathering(input);
    const LaneContacts<D> f = K::test(d, columns.lanes(d));
    const hn::Vec<D> rows[7] = {f.depth, f.normal.x, f.normal.y, f.normal.z, f.point.x, f.point.y, f.point.z};
    for (std::size_t r = 0; r < 7; ++r) hn::Store(rows[r], d, found[r]);
    std::uint8_t hits[8] = {};
    hn::StoreMaskBits(d, f.hit, hits);
    for (std::size_t i = 0; i < count; ++i) {
      if ((hits[0] >> i & 1) == 0) continue;
      const KernelPair& pair = input.pairs[begin + i];
      double v[7];
      for (std::size_t r = 0; r < 7; ++r) v[r] = found[r][i];
      if (pair.flipped != 0) {
        for (std::size_t r = 0; r < 3; ++r) {
          v[1 + r] = -v[1 + r];
          v[4 + r] -= columns.offset[r][i];
        }
      }
      float w[7];
      for (std::size_t r = 0; r < 7; ++r) w[r] = static_cast<float>(v[r]) + 0.0f;
      *out++ = {pair.pair, w[0] > 0 ? w[0] : 0.0f, {w[1], w[2], w[3]}, {w[4], w[5], w[6]}};
    }
    counters.lanes += lanes;
  }
  return out;
}

template <class K>
PairContact* run(const KernelInput& input, PairContact* out, KindCounters& counters) {
  counters.lanes_filled += input.pairs.size();
  return input.in_double ? run_in_double<K>(input, out, counters) : run_in_float<K>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
