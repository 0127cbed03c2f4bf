#pragma once

#include <cstdint>
#include <span>

#include "geometry/shape_table.hpp"
#include "narrow_phase/axis_memory.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "telemetry/clock.hpp"

/// The meeting point of the narrow phase and its kernels: what a kernel of one pair of kinds is given, and what it
/// gives back. Only engine/narrow_phase includes this.
namespace ringfence::narrow_phase {

/// One candidate as a kernel gets it, its two bodies in the order of their kinds. 16 bytes, so that a vector kernel
/// transposes four of them at once.
struct KernelPair {
  std::uint32_t first;    ///< index into the bodies; its kind is <= that of `second`
  std::uint32_t second;   ///< index into the bodies
  std::uint32_t pair;     ///< index into the candidates, for PairContact::pair
  std::uint32_t flipped;  ///< 0 where `first` is the pair's a; `flip_bit` where `first` is the pair's b
};
static_assert(sizeof(KernelPair) == 16);

/// The sign bit of a float: a kernel turns the normal of a flipped pair by one exclusive or.
inline constexpr std::uint32_t flip_bit = 0x80000000u;

/// Times what a kernel spends in gathering; the kernel notes where that begins and ends.
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
  std::uint64_t clock_reads() const noexcept { return clock_reads_; }  ///< at the clock

 private:
  std::uint64_t begin_ = 0, gathered_ = 0, clock_reads_ = 0;
};

/// What a kernel works on. Every pair has the kernel's kinds; for pairs of one kind `first` is always the pair's a.
struct KernelInput {
  std::span<const Body> bodies;
  const geometry::ShapeTable& shapes;
  std::span<const KernelPair> pairs;
  /// The sizes of the two differ so much (`needs_double`) that rounding to float would show against the smaller one:
  /// compute in double, positions and quaternions (normalised in double) included. The same for all pairs of an input;
  /// a function of the two shapes alone.
  bool in_double = false;
  GatherTimer* gather_timer = nullptr;  ///< of pairs that are timed; null for all others
  AxisMemory* memory = nullptr;         ///< null where axes are not remembered; only kernels of polytopes look at it
};

/// Around what a kernel does to gather.
inline void begin_gathering(const KernelInput& input) noexcept {
  if (input.gather_timer != nullptr) input.gather_timer->begin();
}
inline void end_gathering(const KernelInput& input) noexcept {
  if (input.gather_timer != nullptr) input.gather_timer->end();
}

/// A kernel may write this many contacts past the ones it keeps: full vectors leave it without a branch.
inline constexpr std::size_t contact_slack = 16;

/// Tests `input.pairs`, writes the contacts found to `out` in the order of the pairs and returns the end of what it
/// wrote.
///
/// `out` has room for `input.pairs.size() + contact_slack` contacts. PairContact is in terms of the candidate's own a
/// and b: `normal` points from a to b and `point` is relative to a's position, so a flipped pair is turned round before
/// it is written. The kernel adds to `lanes`, `lanes_filled`, `iterations` and `ended_early` of `counters`; the rest is
/// counted by the caller. What is found for a pair depends on nothing but its two shapes and poses. No allocation, no
/// exception, no state between calls.
using Kernel = PairContact* (*)(const KernelInput& input, PairContact* out, KindCounters& counters);

// Closed forms, in lanes (primitive_kernels.cpp).
PairContact* test_sphere_sphere(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_sphere_box(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_sphere_capsule(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_box_box(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_box_capsule(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_capsule_capsule(const KernelInput& input, PairContact* out, KindCounters& counters);

// Convex hulls (round_hull_kernels.cpp, box_hull_kernels.cpp, convex_kernels.cpp).
PairContact* test_sphere_hull(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_box_hull(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_capsule_hull(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_hull_hull(const KernelInput& input, PairContact* out, KindCounters& counters);

/// Any convex kind first, a support shape second (support_shape*.cpp). On libccd: this one may allocate.
PairContact* test_support_any(const KernelInput& input, PairContact* out, KindCounters& counters);

// Meshes (mesh*.cpp). Those with a support shape are on libccd and may allocate.
PairContact* test_sphere_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_box_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_capsule_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_hull_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_mesh_mesh(const KernelInput& input, PairContact* out, KindCounters& counters);
PairContact* test_mesh_support(const KernelInput& input, PairContact* out, KindCounters& counters);

/// The kernel for two kinds, `first` <= `second`: there is one for every two.
Kernel kernel_of(ShapeKind first, ShapeKind second) noexcept;

}  // namespace ringfence::narrow_phase
