#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "base/number_index.hpp"
#include "ringfence/motion_model.hpp"
#include "worlds/motion_file.hpp"

namespace ringfence::worlds {

/// Motion model that replays recorded movement. In frame k an object takes the pose of its row for frame k; without
/// such a row it keeps its pose. A row that is a jump sets MotionOutput::jump. Contacts have no effect.
///
/// Rows are stored by frame, and those of a frame in the order of the objects' first positions, in rows along x. A
/// world stores objects that are spawned together in nearly the same order, so a frame reads rows from ascending
/// addresses, and only those of the objects that it moves. The state of an object is the index of its next row and the
/// frame of that row.
///
/// Immutable: may be used by any number of threads. Memory: 48 bytes a row.
class ReplayModel final : public MotionModel {
 public:
  /// Copies and sorts the rows. Throws Error for 2^32 - 1 rows or more, and for frame numbers of 2^30 or more.
  explicit ReplayModel(const Motion& motion);

  std::string_view name() const noexcept override { return "replay"; }
  /// A hash of the rows.
  std::uint64_t version() const noexcept override { return version_; }
  std::size_t state_bytes() const noexcept override;
  void start(const ObjectSpec& spec, std::byte* state) const override;
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override;

 private:
  /// State of an object: its next row, and the frame of that row.
  struct Cursor {
    std::uint32_t row;  ///< index in rows_; rows_.size() after the last
    std::uint32_t frame;
  };
  /// What an object takes in a frame, and where its next row is.
  struct Row {
    Pose pose;
    std::uint32_t next;  ///< as Cursor::row
    std::uint32_t next_frame : 30, present : 1, jump : 1;
  };
  static_assert(sizeof(Row) == 48);

  std::vector<ObjectNumber> rank_objects(const Motion& motion);
  void link_rows(const Motion& motion);
  std::uint64_t hash(const std::vector<ObjectNumber>& ranked) const noexcept;
  bool is_due(const Cursor& cursor, std::uint64_t frame) const noexcept {
    return cursor.frame <= frame && cursor.row < rows_.size();
  }

  std::vector<Row> rows_;       ///< by frame, then by rank of the object
  base::NumberIndex ranks_;     ///< of the objects that have rows
  std::vector<Cursor> starts_;  ///< by rank: the first row
  std::uint64_t version_ = 0;
};

}  // namespace ringfence::worlds
