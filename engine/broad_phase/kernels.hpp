#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "broad_phase/pair_sink.hpp"
#include "broad_phase/row_grid.hpp"
#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// The inner loops of the sweep, compiled for each instruction set and selected at run time. All versions find the same
/// pairs.
struct Kernels {
  /// Numbers of slots of each kind. The slots are written in ascending order. `moving` needs room for all slots and 64
  /// more, `leaving` for the slots in the resting set.
  struct SlotCounts {
    std::size_t moving;   ///< written to `moving`: present, and not at rest in the resting set
    std::size_t leaving;  ///< written to `leaving`: in the resting set, but no longer at rest
    std::size_t pending;  ///< those of `moving` that are at rest and not yet in the resting set
  };
  SlotCounts (*classify_slots)(std::span<const std::uint8_t> present, std::span<const std::uint8_t> resting,
                               const std::uint8_t* in_resting_set, std::uint32_t* moving, std::uint32_t* leaving);

  /// Puts the boxes of `slots` that are within the grid's size limit into its buckets. Writes the other slots to
  /// `larger` (which may be `slots` itself) and returns their number. `layers` (by slot, see SweepAndPrune::find) may
  /// be null if the grid has no layer masks and nothing is static.
  std::size_t (*stage)(RowGrid& grid, const geometry::Bounds* bounds, const std::uint8_t* layers,
                       const std::uint32_t* slots, std::size_t count, std::uint32_t* larger);

  /// Sorts the boxes of a bucket by cell and computes their codes. Buckets are sorted in ascending order, each once.
  void (*sort)(RowGrid& grid, std::uint32_t bucket);

  /// Finds the pairs of the grid's boxes at positions [first, last) with boxes at later positions, if their layers
  /// collide.
  void (*sweep)(const RowGrid& grid, std::uint32_t first, std::uint32_t last, PairSink& sink);

  /// Finds the pairs of the boxes of `a` at positions [first, last) with all boxes of `b`, if their layers collide.
  /// Precondition: both grids have the same layer masks.
  void (*query)(const RowGrid& a, std::uint32_t first, std::uint32_t last, const RowGrid& b, PairSink& sink);

  std::size_t lanes;  ///< number of codes that one vector compares
};

/// The kernels for the widest instruction set that this machine supports and Highway does not exclude.
Kernels choose_kernels();

}  // namespace ringfence::broad_phase
