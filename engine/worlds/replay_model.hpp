#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "ringfence/motion_model.hpp"
#include "worlds/motion_file.hpp"

namespace ringfence::worlds {

/// Moves objects as recorded: in frame k each object takes the pose of its row for frame k, if it has one, and stands
/// still otherwise. No response.
///
/// An object's state is its place in its own rows, so `move` finds a row in constant time. Immutable; any thread.
class ReplayModel final : public MotionModel {
 public:
  explicit ReplayModel(const Motion& motion);

  std::size_t state_bytes() const noexcept override;
  void start(const ObjectSpec& spec, std::byte* state) const override;
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override;

 private:
  struct Cursor;

  std::vector<MotionRow> rows_;                                          ///< by object, then frame
  std::unordered_map<ObjectNumber, std::uint32_t> first_row_by_object_;  ///< of an object's rows
};

}  // namespace ringfence::worlds
