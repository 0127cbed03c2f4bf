#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/bounds.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "nodes/number_index.hpp"
#include "regions/region_map.hpp"
#include "ringfence/object.hpp"

namespace ringfence::nodes {

/// What the server knows of an object besides its bounds.
struct ObjectRow {
  messages::ObjectRef object;  ///< flags: flag_present
  Pose pose;
  std::uint64_t user_data = 0;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;
  std::uint16_t category = 0;
  UserNumber user = no_user;  ///< of an avatar
  messages::Endpoint host = messages::Endpoint::none();
  regions::CellBox told;  ///< the cells whose owners have been told of the object
  bool alive = false;
  bool is_told = false;           ///< `told` holds
  bool moved = false;             ///< listed in moved()
  bool reported_by_node = false;  ///< this frame's state came from the CD node that hosts it
};

/// The server's table of objects, by slot. A slot belongs to one object from its spawn to the frame after its end.
///
/// Threads: belongs to the server role in a frame, to the facade between frames. Memory: reserved, grown at spawns.
class ObjectTable {
 public:
  /// `state_bytes` is the model's state, a multiple of 8.
  ObjectTable(std::size_t objects, std::size_t state_bytes);

  /// Slots in use or used before; rows() and bounds() have this size.
  std::size_t slots() const noexcept { return rows_.size(); }
  std::size_t live() const noexcept { return index_.size(); }
  ObjectRow& row(std::uint32_t slot) noexcept { return rows_[slot]; }
  const ObjectRow& row(std::uint32_t slot) const noexcept { return rows_[slot]; }
  std::span<const geometry::Bounds> bounds() const noexcept { return bounds_; }
  geometry::Bounds& bounds(std::uint32_t slot) noexcept { return bounds_[slot]; }
  /// One byte a slot: whether it holds a present object.
  std::span<const std::uint8_t> present() const noexcept { return present_; }
  /// One byte a slot: whether bounds and presence are as in the frame before.
  std::span<const std::uint8_t> resting() const noexcept { return resting_; }
  /// One byte a slot: the layer of its object; a slot that changes it is not resting.
  std::span<const std::uint8_t> layers() const noexcept { return layers_; }
  std::byte* state(std::uint32_t slot) noexcept { return states_.data() + slot * state_bytes_; }
  std::size_t state_bytes() const noexcept { return state_bytes_; }
  /// The slot of a live object, or NumberIndex::none.
  std::uint32_t find(ObjectNumber number) const noexcept { return index_.find(number); }
  /// The slot that a message speaks of, if it holds exactly that object; else NumberIndex::none.
  std::uint32_t find(const messages::ObjectRef& object) const noexcept;

  /// Makes an object and returns its slot; its model state is zero, its bounds are not set.
  std::uint32_t add(ObjectId id, const ObjectSpec& spec);
  /// Ends an object; its slot keeps its row until release_ended().
  void end(std::uint32_t slot);
  /// Ends the frame's bookkeeping: nothing has moved, and slots ended before this frame may be used again.
  void settle();

  /// Notes that pose or presence changed; keeps `present` in step with the row.
  void mark_moved(std::uint32_t slot);
  /// Slots that moved, appeared or ended in this frame, each once.
  std::span<const std::uint32_t> moved() const noexcept { return moved_; }

 private:
  std::size_t state_bytes_;
  std::vector<ObjectRow> rows_;
  std::vector<geometry::Bounds> bounds_;
  std::vector<std::uint8_t> present_;
  std::vector<std::uint8_t> resting_;
  std::vector<std::uint8_t> layers_;
  std::vector<std::byte> states_;
  std::vector<std::uint32_t> free_;
  std::vector<std::uint32_t> ended_;  ///< in this frame
  std::vector<std::uint32_t> moved_;
  NumberIndex index_;
};

}  // namespace ringfence::nodes
