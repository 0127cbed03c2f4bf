#pragma once

#include <cstdint>
#include <span>

#include "geometry/shape_table.hpp"
#include "narrow_phase/axis_memory.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "telemetry/clock.hpp"

/// The interface between the narrow phase and its kernels. A kernel tests the pairs of two kinds of shapes. Only
/// engine/narrow_phase includes this header.
namespace ringfence::narrow_phase {

/// A candidate pair as a kernel receives it: the two bodies are in the order of their kinds. It has 16 bytes, so that a
/// vector kernel can transpose four pairs at once.
struct KernelPair {
  std::uint32_t first;    ///< index into the bodies; its kind is <= that of `second`
  std::uint32_t second;   ///< index into the bodies
  std::uint32_t pair;     ///< index into the candidates, for PairContact::pair
  std::uint32_t flipped;  ///< 0 where `first` is the pair's a; `flip_bit` where `first` is the pair's b
};
static_assert(sizeof(KernelPair) == 16);

/// The sign bit of a float: a kernel negates the normal of a flipped pair with one exclusive or.
inline constexpr std::uint32_t flip_bit = 0x80000000u;

/// Measures the time that a kernel spends on gathering its input; the kernel calls begin() and end().
class GatherTimer {
 public:
  void begin() noexcept {
    begin_ = telemetry::now_ns();
    ++clock_reads_;
  }
  void end() noexcept {
    gathered_ += telemetry::now_ns() - begin_;
    ++clock_reads_;
  }
  std::uint64_t nanoseconds() const noexcept { return gathered_; }
  std::uint64_t clock_reads() const noexcept { return clock_reads_; }  ///< how often the clock was read

 private:
  std::uint64_t begin_ = 0, gathered_ = 0, clock_reads_ = 0;
};

/// The input of a kernel. Every pair has the kernel's two kinds. If the two kinds are equal, `first` is always the
/// pair's a.
struct KernelInput {
  std::span<const Body> bodies;
  geometry::ShapeView shapes;
  std::span<const KernelPair> pairs = {};
  /// True if the sizes of the two shapes differ so much that rounding to float would be visible relative to the smaller
  /// one (ShapeTag::needs_double in shape_tag.hpp). The kernel then computes everything in double, also positions
  /// and quaternions, which it normalises in double. The value is the same for all pairs of an input and depends on the
  /// two shapes only.
  bool in_double = false;
  GatherTimer* gather_timer = nullptr;  ///< null: these pairs are not timed
  AxisMemory* memory = nullptr;         ///< null: separating axes are not cached; only the kernel of two hulls uses it
  /// Used instead of `pairs` unless it is empty: consecutive candidates, from index `first_candidate` on, so that no
  /// list has to be written. Only for kernels of two spheres, boxes or capsules, in float.
  std::span<const geometry::CandidatePair> candidates = {};
  std::uint32_t first_candidate = 0;

  /// Selects `count` pairs of `all`, from pair `begin` on.
  void select(const KernelInput& all, std::size_t begin, std::size_t count) noexcept {
    if (all.candidates.empty()) {
      pairs = all.pairs.subspan(begin, count);
    } else {
      candidates = all.candidates.subspan(begin, count);
      first_candidate = all.first_candidate + static_cast<std::uint32_t>(begin);
    }
  }
};

/// Kernels call these before and after they gather their input.
inline void begin_gathering(const KernelInput& input) noexcept {
  if (input.gather_timer != nullptr) input.gather_timer->begin();
}
inline void end_gathering(const KernelInput& input) noexcept {
  if (input.gather_timer != nullptr) input.gather_timer->end();
}

/// A kernel may write up to this many contacts past the end that it returns: it stores whole vectors, which avoids a
/// branch.
inline constexpr std::size_t contact_slack = 16;

/// Tests the pairs of `input`, writes the contacts to `out` in their order, and returns the end of what it wrote.
///
/// `out` has room for `contact_slack` contacts more than there are pairs. A PairContact refers to the candidate's own a
/// and b: `normal` points from a to b and `point` is relative to a's position. The kernel converts the result of a
/// flipped pair. The kernel adds to `lanes`, `lanes_filled`, `iterations`, `ended_early` and `failed` of `counters`;
/// the caller counts the rest. The result for a pair depends on nothing but its two shapes and poses. A kernel throws
/// nothing, allocates nothing unless it uses libccd, and keeps no state between calls except in `input.memory`. Any
/// thread may call it, with an `input.memory` of its own.
using Kernel = PairContact* (*)(const KernelInput& input, PairContact* out, KindCounters& counters);

// Closed forms, one pair per lane (primitives/).
PairContact* test_sphere_sphere(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_sphere_box(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_sphere_capsule(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_box_box(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_box_capsule(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_capsule_capsule(const KernelInput& input, PairContact* out, KindCounters& counters);

// Convex hulls (hull/).
PairContact* test_sphere_hull(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_box_hull(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_capsule_hull(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_hull_hull(const KernelInput& input, PairContact* out, KindCounters& counters);

/// The first shape is of any convex kind, the second is a support shape (support/). Uses libccd, which may allocate.
PairContact* test_support_any(const KernelInput& input, PairContact* out, KindCounters& counters);

// Meshes (mesh/). The kernel for support shapes uses libccd, which may allocate.
PairContact* test_sphere_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_box_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_capsule_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_hull_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_mesh_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_mesh_support(const KernelInput& input, PairContact* out, KindCounters& counters);

/// The kernel for two kinds. Never null. Precondition: `first` <= `second`.
Kernel kernel_of(ShapeKind first, ShapeKind second) noexcept;

}  // namespace ringfence::narrow_phase
