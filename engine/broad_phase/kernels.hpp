#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "broad_phase/pair_sink.hpp"
#include "broad_phase/row_grid.hpp"
#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// The sweep's inner loops, compiled for each instruction set and chosen at run time. All of them find the same pairs.
struct Kernels {
  /// Slots of each kind, ascending. `entering` wants room for all slots and 64 more, `leaving` for as many as are kept.
  struct SlotCounts {
    std::size_t moving;   ///< written to `moving`: present, and not kept at rest
    std::size_t leaving;  ///< written to `leaving`: kept, but not at rest any more
    std::size_t pending;  ///< how many of `moving` are at rest
  };
  SlotCounts (*classify_slots)(std::span<const std::uint8_t> present, std::span<const std::uint8_t> resting,
                               const std::uint8_t* kept, std::uint32_t* moving, std::uint32_t* leaving);

  /// Puts the boxes of `slots` that fit the grid's limit into its buckets; writes the others to `larger` (may be
  /// `slots` itself) and returns how many. `layers` by slot, read only if the grid has layer masks.
  std::size_t (*stage)(RowGrid& grid, const geometry::Bounds* bounds, const std::uint8_t* layers,
                       const std::uint32_t* slots, std::size_t count, std::uint32_t* larger);

  /// Sorts the boxes of a bucket by cell and codes them; the buckets in order, each once.
  void (*sort)(RowGrid& grid, std::uint32_t bucket);

  /// Pairs of a grid's boxes at the positions [first, last) with those after them, as far as their layers collide.
  void (*sweep)(const RowGrid& grid, std::uint32_t first, std::uint32_t last, PairSink& sink);

  /// Pairs of the boxes of `a` at the positions [first, last) with all boxes of `b`, as far as their layers
  /// collide. Both have the same layer masks.
  void (*query)(const RowGrid& a, std::uint32_t first, std::uint32_t last, const RowGrid& b, PairSink& sink);

  std::size_t lanes;  ///< codes compared at once
};

/// The kernels of the widest instruction set that this machine has and Highway has not been told to avoid.
Kernels choose_kernels();

}  // namespace ringfence::broad_phase
