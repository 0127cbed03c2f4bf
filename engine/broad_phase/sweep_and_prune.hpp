#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "broad_phase/layers.hpp"
#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// Finds every candidate pair of a frame, each exactly once.
///
/// Moving boxes are sorted again in each frame: by size into levels, and within a level by bucket and then by cell (z
/// slab, y row, x cell), with an eight-byte code per box. The sweep compares the code of a box with the following codes
/// of its row, one vector at a time, and searches neighbour rows only where the box reaches into them. An exact test
/// follows. Resting boxes are kept in a separate set together with the pairs among them; only the moving boxes query
/// it. Rows, cells and levels are planned from a sample of the boxes. Cells wrap around, so that the size of the table
/// follows the number of boxes and not the size of the world. Method: sweep and prune (Cohen et al. 1995), in short
/// rows (Terdiman 2017), over size levels as in hierarchical grids (Mirtich 1997).
///
/// Cost: nearly linear in boxes and pairs. With AVX-512 and 0.5 pairs per box it is 10 to 30 ns per box from 4,000 to
/// 1,000,000 boxes, for any size and shape of the world; 35 to 55 ns in a heap with 1.6 pairs per box. Worlds that cost
/// more, measured with 64,000 boxes:
/// - n boxes in one place have n^2/2 pairs, which no method avoids: 3 to 5 ns per pair;
/// - two halves of a world whose sizes differ by a factor of 20 or 1000: 35 to 55 ns per box, since the larger boxes
///   query the cells that they cover, or the smaller ones query the larger, whichever is cheaper;
/// - the worst case: boxes that are very long on one axis and thin on the others, half as long as the world, with all
///   three directions mixed. They share a level whose rows are as deep as the boxes are long, and every code is
///   compared with every other, eight at a time (n^2/16 vector steps): 380 to 540 ms. Rods of a twentieth of the world
///   cost 25 ns per box.
///
/// Threads: one instance belongs to one thread at a time. Memory: grows to the largest frame seen (about 100 bytes per
/// object, twice that where objects rest, and 8 per pair) and never shrinks; in steady state nothing is allocated.
/// Failure: std::bad_alloc while memory grows. The set of pairs does not depend on the machine; their order does.
class SweepAndPrune {
 public:
  /// Reserves memory for `objects` objects and `pairs` pairs. Both may be exceeded later, at the cost of an allocation.
  /// Bit j of layer_masks[i] says whether layers i and j collide; the masks must be symmetric. By default all layers
  /// collide. With `keep_resting` false all boxes are treated as moving: the pairs are the same, for comparison.
  SweepAndPrune(std::size_t objects, std::size_t pairs, const LayerMasks& layer_masks = all_layers_collide(),
                bool keep_resting = true);
  ~SweepAndPrune();
  SweepAndPrune(SweepAndPrune&&) noexcept;
  SweepAndPrune& operator=(SweepAndPrune&&) noexcept;

  /// Returns all pairs i, j with touch(bounds[i], bounds[j]) among the slots whose present[] is non-zero. The order of
  /// the pairs, and of i and j in a pair, is not specified; pairs that are close in space are mostly close in the list.
  ///
  /// `layers[i]` is the layer of slot i, below 32, with `fixed_object` if its object is static. Pairs whose layers do
  /// not collide and pairs of two static objects are left out. The span may be empty where all layers collide and
  /// nothing is static.
  ///
  /// `groups[i]` is the group of slot i; pairs of one group other than 0 are left out. The span may be empty where all
  /// groups are 0.
  ///
  /// `crowds[i]` is the crowd of slot i, or 0; pairs that crowds_collide() excludes are left out. The span may be empty
  /// where all crowds are 0. The cost of boxes on one spot that exclude each other is proportional to their number, for
  /// the 16 crowds with the most of them.
  ///
  /// `resting[i]` is non-zero where bounds[i], present[i], layers[i], groups[i] and crowds[i] have not changed since
  /// the last call. The sweep may rely on it; all zeros are always correct. The spans have equal size, below 2^31,
  /// which may differ from call to call. Precondition: lower <= upper on each axis. The result is valid until the next
  /// call of any member.
  ///
  /// A separate set of resting boxes is used from the point where two thirds of the boxes rest until less than half of
  /// them do. A box that comes to rest costs as much as before for some frames: the set is rebuilt when the work that a
  /// rebuild would have saved equals its cost. The call that rebuilds takes as long as if all boxes moved.
  std::span<const geometry::CandidatePair> find(std::span<const geometry::Bounds> bounds,
                                                std::span<const std::uint8_t> present,
                                                std::span<const std::uint8_t> resting,
                                                std::span<const std::uint8_t> layers = {},
                                                std::span<const std::uint32_t> groups = {},
                                                std::span<const std::uint32_t> crowds = {});

  /// The same in portions, so that pairs can be processed while the sweep continues: call begin(), then next() until it
  /// returns an empty span. The arguments are as in find(). `groups` and `crowds` are read until then; the others are
  /// not read after begin() has returned.
  void begin(std::span<const geometry::Bounds> bounds, std::span<const std::uint8_t> present,
             std::span<const std::uint8_t> resting, std::span<const std::uint8_t> layers = {},
             std::span<const std::uint32_t> groups = {}, std::span<const std::uint32_t> crowds = {});

  /// Returns the next pairs: `most` (>= 1) of them, fewer only at the end, none when there are no more. The result is
  /// valid until the next call of any member. Another begin() or find() abandons the sweep.
  std::span<const geometry::CandidatePair> next(std::size_t most);

  /// One word for each of the first pairs that next() returns in this sweep: the pairs of two boxes of the resting set.
  /// A word is 0 if the sweep before did not have the pair in this set, else what the caller wrote there. The words are
  /// kept as long as both boxes rest and the set is not rebuilt. So a caller need not test a pair again whose objects
  /// do not change. Valid until the next begin() or find().
  std::span<std::uint32_t> kept_words() noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence::broad_phase
