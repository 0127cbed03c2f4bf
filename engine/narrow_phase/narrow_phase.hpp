#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "ringfence/frame_report.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

/// An object as the narrow phase sees it.
struct Body {
  Pose pose;  ///< finite, orientation unit (normalised at the edge)
  ShapeNumber shape = 0;
  ObjectNumber number = 0;
};
static_assert(sizeof(Body) == 48);

/// A pair found in contact; see ringfence::Contact for the meaning of the fields.
struct PairContact {
  std::uint32_t pair = 0;  ///< index into the candidates that were given
  float depth = 0;         ///< metres, >= 0
  Vec3f normal;            ///< unit, from a to b
  Vec3f point;             ///< relative to a's position, world axes, metres
};
static_assert(sizeof(PairContact) == 32);

/// Work done since the last call of `reset_counters`, by kinds [min][max] of the pair. The same fields as KindReport's,
/// which says what they mean.
struct KindCounters {
  std::uint64_t candidates = 0;
  std::uint64_t hits = 0;
  std::uint64_t lanes = 0;
  std::uint64_t lanes_filled = 0;
  std::uint64_t iterations = 0;
  std::uint64_t ended_early = 0;
  std::uint64_t timed = 0;        ///< candidates whose kernel was timed: about one in thirty to sixty
  std::uint64_t nanoseconds = 0;  ///< in the kernel for those, gathering included, sorting not
  std::uint64_t gather_nanoseconds = 0;
  std::uint32_t cost[cost_buckets] = {};
};

/// Tests candidate pairs exactly: which are in contact, and how.
///
/// Sorts the pairs by kind, gathers them into blocks and runs one kernel a block. What it answers for a pair depends
/// on the two shapes and poses alone: not on the other pairs, their order, the SIMD width or earlier calls. It works
/// in float on the difference of the two positions, taken in double.
///
/// Threads: one instance belongs to one thread at a time; the shape table is shared read-only. Memory: grows to the
/// largest call seen; in steady state nothing is allocated (support shapes on libccd excepted).
class NarrowPhase {
 public:
  explicit NarrowPhase(const geometry::ShapeTable& shapes);
  ~NarrowPhase();
  NarrowPhase(NarrowPhase&&) noexcept;
  NarrowPhase& operator=(NarrowPhase&&) noexcept;

  /// All contacts among `pairs` (indices into `bodies`, `a` has the lower number), in no particular order.
  /// The result lives until the next call.
  std::span<const PairContact> test(std::span<const Body> bodies, std::span<const geometry::CandidatePair> pairs);

  /// Whether separating axes of pairs of hulls are remembered from call to call by the bodies' numbers; off at first.
  /// It changes the cost of pairs that are apart, and no answer: a remembered axis ends a test only where it keeps the
  /// two apart by 10^-5 of their sizes, far more than what rounding can hide. Turning it on takes 128 KiB, and no more
  /// however long it is on.
  void remember_axes(bool on);
  void forget_axes() noexcept;

  /// `kinds` as in ShapeKind; symmetric.
  const KindCounters& counters(ShapeKind p, ShapeKind q) const noexcept;
  void reset_counters() noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence::narrow_phase
