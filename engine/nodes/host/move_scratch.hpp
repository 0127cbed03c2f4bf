#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/flat_list.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::nodes {

/// The memory that one move of a Host needs: what the model receives and returns for a batch, and the list of changes.
/// Hosts that one thread moves one after another share it, so that it stays in the cache.
///
/// Threads: belongs to one thread at a time. Memory: grows to the largest batch and the largest host.
struct MoveScratch {
  // Of the largest batch so far.
  std::vector<MotionInput> inputs;
  std::vector<MotionOutput> outputs;
  std::vector<std::byte> states;  ///< the model's states in `outputs`
  base::FlatList<std::uint32_t> changed;
  base::FlatList<std::uint8_t> differs;  ///< parallel to `changed`

  /// Ensures room for a batch of `count` objects with `state_bytes` bytes of model state each.
  void grow_batch(std::size_t count, std::size_t state_bytes) {
    inputs.resize(count);
    outputs.resize(count);
    states.resize(count * state_bytes);
  }
};

}  // namespace ringfence::nodes
