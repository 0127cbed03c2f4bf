#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/numbers.hpp"
#include "facade/requests/requests.hpp"
#include "facade/save/saved_world.hpp"
#include "facade/world_state.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::facade {

/// Shapes that were registered and removed since the last cut, for WorldConfig::recorder.
struct ShapeChanges {
  std::vector<ShapeNumber> added, removed;

  bool empty() const noexcept { return added.empty() && removed.empty(); }
  void clear() noexcept { added.clear(), removed.clear(); }
};

/// What Recorder::begin_frame receives: all calls since the last cut that were not refused; empty if there are none.
/// Call before Requests::cut(). Throws std::bad_alloc.
std::vector<std::byte> record_inputs(const WorldState& state, const Requests& requests, const ShapeChanges& shapes);

/// The same again. Throws Error unless they fit the world.
struct RecordedInputs {
  std::vector<std::pair<ShapeNumber, ShapeDescription>> added;
  std::vector<ShapeNumber> removed;
  std::uint32_t last_number = 0, generation = 0;
  std::vector<SavedRequest> requests;
  std::vector<std::byte> states;
  std::vector<SavedMove> moves;
  std::vector<SavedInput> inputs;
};
RecordedInputs read_inputs(std::span<const std::byte> bytes,
                           std::span<const std::shared_ptr<const SupportFunction>> functions);

/// Makes the calls again, except those that are pending already: a save between two cuts has the first of them. The
/// shapes are registered. Throws Error unless they fit the world; then no frame may follow.
void apply_inputs(const RecordedInputs& inputs, const WorldState& state, Requests& requests);

}  // namespace ringfence::facade
