#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/profile.hpp"

namespace ringfence::narrow_phase {

/// An object in the narrow phase, with all that a contact or the answer to a query says of it: one cache line. Kernels
/// read pose and shape.
struct alignas(64) Body {
  Pose pose;  ///< finite; the orientation is a unit quaternion (normalised where it enters the engine)
  ShapeNumber shape = 0;
  ObjectNumber number = 0;
  std::uint32_t generation = 0;
  std::uint16_t layer = 0;
  std::uint16_t category = 0;  ///< a ringfence::Category
  std::uint64_t user_data = 0;
};
static_assert(sizeof(Body) == 64);

/// A contact of a candidate pair; see ringfence::Contact for the meaning of the fields.
struct PairContact {
  std::uint32_t pair = 0;  ///< index into the candidate pairs
  float depth = 0;         ///< metres, >= 0
  Vec3f normal;            ///< unit, from a to b
  Vec3f point;             ///< relative to a's position, world axes, metres
};
static_assert(sizeof(PairContact) == 32);

/// Work since the last call of `reset_counters`, by kinds [min][max] of the pair. Most fields are those of KindReport,
/// which documents them.
struct KindCounters {
  std::uint64_t candidates = 0;
  std::uint64_t hits = 0;
  std::uint64_t lanes = 0;
  std::uint64_t lanes_filled = 0;
  std::uint64_t iterations = 0;
  std::uint64_t ended_early = 0;
  std::uint64_t failed = 0;       ///< candidates without a result because a support function failed
  std::uint64_t timed = 0;        ///< candidates whose kernel was timed: about one in thirty to sixty
  std::uint64_t nanoseconds = 0;  ///< time in the kernel for those, including gathering, without sorting
  std::uint64_t gather_nanoseconds = 0;
  std::uint32_t cost[cost_buckets] = {};
};

/// Tests candidate pairs exactly: which of them are in contact, and with what depth, normal and point.
///
/// Sorts the pairs by kind, gathers them into blocks and runs one kernel per block. The result for a pair depends only
/// on the two shapes and poses: not on the other pairs, their order, the SIMD width or earlier calls. Computes in float
/// on the difference of the two positions, which is computed in double.
///
/// Threads: one instance belongs to one thread at a time; the shape table is shared read-only. Memory: grows to the
/// largest call so far; in steady state nothing is allocated, except for support shapes, which use libccd.
class NarrowPhase {
 public:
  explicit NarrowPhase(const geometry::ShapeTable& shapes);
  ~NarrowPhase();
  NarrowPhase(NarrowPhase&&) noexcept;
  NarrowPhase& operator=(NarrowPhase&&) noexcept;

  /// Returns all contacts among `pairs` (indices into `bodies`; `a` has the lower number), in no particular order. A
  /// pair for which a support function fails (see geometry::CheckedSupport) has none, and is counted as `failed`. The
  /// result is valid until the next call.
  std::span<const PairContact> test(std::span<const Body> bodies, std::span<const geometry::CandidatePair> pairs);

  /// Whether separating axes of pairs of hulls are cached from call to call, by the numbers of the bodies. Initially
  /// off. The cache changes the cost of pairs that are apart, but no result: a cached axis ends a test only if it
  /// separates the two shapes by at least 10^-5 of their sizes, far more than the rounding error. Takes 128 bytes for
  /// each of `bodies`, the number of bodies that calls usually have, but at least 16 and at most 128 KiB.
  void remember_axes(bool on, std::size_t bodies = std::size_t{1} << 10);
  void forget_axes() noexcept;

  /// The counters of two kinds, in either order.
  const KindCounters& counters(ShapeKind p, ShapeKind q) const noexcept;
  void reset_counters() noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence::narrow_phase
