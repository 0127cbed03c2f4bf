#pragma once

#include <cstdint>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "ringfence/motion_model.hpp"
#include "worlds/motion_file.hpp"

namespace ringfence::worlds {

/// Motion model that replays recorded movement. In frame k an object takes the pose of its row for frame k; without
/// such a row it keeps its pose. A row that is a jump sets MotionOutput::jump. Contacts have no effect.
///
/// The state of an object is the index of its next row, so `move` finds a row in constant time. Immutable: may be used
/// by any number of threads.
class ReplayModel final : public MotionModel {
 public:
  /// Copies and sorts the rows. Throws Error for 2^32 - 1 rows or more.
  explicit ReplayModel(const Motion& motion);

  std::string_view name() const noexcept override { return "replay"; }
  /// A hash of the rows.
  std::uint64_t version() const noexcept override { return version_; }
  std::size_t state_bytes() const noexcept override;
  void start(const ObjectSpec& spec, std::byte* state) const override;
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override;

 private:
  struct Cursor;

  std::vector<MotionRow> rows_;                                          ///< sorted by object, then by frame
  std::unordered_map<ObjectNumber, std::uint32_t> first_row_by_object_;  ///< indices in rows_
  std::uint64_t version_ = 0;
};

}  // namespace ringfence::worlds
