#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

using LayerMasks = std::array<std::uint32_t, 32>;
constexpr LayerMasks all_layers_collide() noexcept {
  LayerMasks masks{};
  masks.fill(~std::uint32_t{0});
  return masks;
}

/// Finds every candidate pair of a frame, each exactly once.
///
/// What moves is sorted anew each frame: by size into levels, in a level by bucket and then by cell, z-slab, y-row and
/// x-cell, with an eight-byte code a box. The sweep compares a box's code with those behind it in its own row, a vector
/// at a time, and looks into neighbour rows only where the box reaches; an exact test follows. What rests is kept in a
/// structure of its own together with the pairs among it, and only asked by what moves. Rows, cells and levels are
/// planned from a sample of the boxes. Cells wrap around, so that the table follows the number of boxes and not the
/// size of the world. Method: sweep and prune (Cohen et al. 1995), in short rows (Terdiman 2017), over size levels as
/// in hierarchical grids (Mirtich 1997).
///
/// Cost: near linear in boxes and pairs: with AVX-512 and half a pair a box, 10 to 30 ns a box from 4,000 to 1,000,000,
/// whatever the world's size and shape; 35 to 55 in a heap with 1.6 pairs a box. What costs more, measured with 64,000
/// boxes:
/// - n boxes in one spot have n^2/2 pairs, which no method avoids: 3 to 5 ns a pair;
/// - halves of a world that differ in size by 20 or 1000: 35 to 55 ns a box, since the larger are asked about the cells
///   that they cover, or the smaller about the larger, whichever is cheaper;
/// - the worst case: boxes very long on one axis and thin on the others, each kind as long as half the world, mixed.
///   They share a level whose rows are as deep as they are long, and every code is compared with every other, eight at
///   once (n^2/16 vector steps): 380 to 540 ms. Rods of a twentieth of the world cost 25 ns a box.
///
/// Threads: one instance belongs to one thread at a time. Memory: grows to the largest frame seen (about 100 bytes an
/// object, twice that where some rest, and 8 a pair), never shrinks; in steady state nothing is allocated. Fails only
/// by std::bad_alloc while it grows. The pairs do not depend on the machine; their order does.
class SweepAndPrune {
 public:
  /// Reserves for `objects` objects and `pairs` pairs. Both may be exceeded later, at the price of an allocation.
  /// Bit j of layer_masks[i] says whether layers i and j collide, the same both ways; without masks all do. Without
  /// `keep_resting` everything is taken to move: the same pairs, for comparison.
  SweepAndPrune(std::size_t objects, std::size_t pairs, const LayerMasks& layer_masks = all_layers_collide(),
                bool keep_resting = true);
  ~SweepAndPrune();
  SweepAndPrune(SweepAndPrune&&) noexcept;
  SweepAndPrune& operator=(SweepAndPrune&&) noexcept;

  /// All pairs i, j (i < j is not promised) with touch(bounds[i], bounds[j]) among those with present[i] and
  /// present[j] non-zero, in no particular order; near each other in space mostly near each other in the list.
  ///
  /// `layers[i]`, below 32, is the layer of slot i: pairs whose layers do not collide are left out before they are
  /// emitted. May be empty where all layers collide.
  ///
  /// `resting[i]` is non-zero where bounds[i], present[i] and layers[i] are what they were at the last call (a promise
  /// that the sweep may use; all zero is always right). The spans have equal size, below 2^32 - 1, which may differ
  /// from call to call. Precondition: lower <= upper on each axis. The result lives until the next call of any member.
  ///
  /// What rests is kept apart from where two thirds rest, until less than a half does. An object that starts to rest
  /// costs as before for a few frames: the structure for what rests is built again when the work that it would have
  /// saved equals its cost. In that frame the call takes as long as if all moved.
  std::span<const geometry::CandidatePair> find(std::span<const geometry::Bounds> bounds,
                                                std::span<const std::uint8_t> present,
                                                std::span<const std::uint8_t> resting,
                                                std::span<const std::uint8_t> layers = {});

  /// The same in portions, so that pairs can be worked on while the sweep goes on: begin(), then next() until it
  /// answers an empty span. The arguments are as in find(), and are not read any more once begin() has returned.
  void begin(std::span<const geometry::Bounds> bounds, std::span<const std::uint8_t> present,
             std::span<const std::uint8_t> resting, std::span<const std::uint8_t> layers = {});

  /// The next pairs, at most `most` (>= 1) and as many unless they are the last; empty when there are no more. The
  /// result lives until the next call of any member. The sweep may be abandoned by another begin() or find().
  std::span<const geometry::CandidatePair> next(std::size_t most);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence::broad_phase
