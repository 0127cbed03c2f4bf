#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/number_index.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::nodes {

/// What a user gives to the motion model for one of its avatars in one frame; see World::input.
struct ObjectInput {
  ObjectNumber number = 0;
  std::uint8_t size = 0;  ///< of the bytes: those that the model receives; at most max_input_bytes
  std::array<std::byte, max_input_bytes> bytes{};
};

/// The inputs of one frame of the objects that a role hosts.
///
/// Threads: belongs to its role. Memory: grows to the most inputs of one frame. Cost: nothing in a frame without
/// inputs; else one search per batch, and one comparison per input.
class FrameInputs {
 public:
  bool empty() const noexcept { return inputs_.empty(); }
  /// Adds an input for the next move; for one object the last one counts.
  void add(const ObjectInput& input) { inputs_.push_back({input, 0, static_cast<std::uint32_t>(inputs_.size())}); }
  /// Finds the hosted objects at the start of a move. Drops the inputs of objects that are not hosted.
  void find_objects(const base::NumberIndex& hosted);
  /// Sets MotionInput::input of those of `batch` that have one. `batch[i]` belongs to hosted object `first` + i.
  /// Precondition: find_objects() was called in this move. The spans live until clear().
  void set(std::size_t first, std::span<MotionInput> batch) const noexcept;
  /// Ends the move.
  void clear() noexcept { inputs_.clear(); }

 private:
  struct Found {
    ObjectInput input;
    std::uint32_t hosted;  ///< index of the hosted object
    std::uint32_t turn;    ///< position in the order of add()
  };

  std::vector<Found> inputs_;  ///< after find_objects(): one per object, ascending by `hosted`
};

}  // namespace ringfence::nodes
