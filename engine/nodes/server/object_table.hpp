#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/number_index.hpp"
#include "base/prefetch.hpp"
#include "geometry/bounds.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "regions/region_map.hpp"
#include "ringfence/object.hpp"

namespace ringfence::nodes {

/// What the server reads of an object each frame: one cache line.
struct alignas(64) ObjectRow {
  messages::ObjectRef object;  ///< flags: flag_present
  Pose pose;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;
  std::uint16_t category = 0;
};
static_assert(sizeof(ObjectRow) == 64);

/// What of an object is read when its host changes or somebody asks.
struct ObjectOrigin {
  std::uint64_t user_data = 0;
  UserNumber user = no_user;  ///< of an avatar
};

/// What holds of an object, as bits.
using ObjectMarks = std::uint16_t;
enum ObjectMark : ObjectMarks {
  alive_mark = 1,
  notified_mark = 2,        ///< nodes have been told of the object: those of ObjectTable::told(), if shared_mark
  shared_mark = 4,          ///< perhaps others than its host have been told of it; else the host alone knows it
  moved_mark = 8,           ///< listed in moved()
  reported_mark = 16,       ///< this frame's state came from the CD node that hosts it
  inner_mark = 32,          ///< and it says that all cells that the bounds touch are its own
  recovered_mark = 64,      ///< of a lost node, in the server's hands until the next cut
  host_changed_mark = 128,  ///< at this cut, from one host to another
  host_owned_mark = 256     ///< its host keeps its states from the server and tells the nodes of it: row, state, bounds
                            ///< and what was told of it may be of an earlier frame here
};

/// The server's table of objects, by slot. A slot belongs to one object from its spawn to the frame after its end.
///
/// What is looked up at random for every pair and contact (numbers, layers, hosts, marks) lies in arrays of its own,
/// small enough for the second-level cache at 64,000 objects; what goes by object lies in rows of a cache line.
///
/// Threads: belongs to the server role in a frame, to the facade between frames. Memory: reserved, grown at spawns.
class ObjectTable {
 public:
  /// `state_bytes` is the model's state, a multiple of 8.
  ObjectTable(std::size_t objects, std::size_t state_bytes);

  /// Slots in use or used before; all spans have this size.
  std::size_t slots() const noexcept { return rows_.size(); }
  std::size_t live() const noexcept { return index_.size(); }
  ObjectRow& row(std::uint32_t slot) noexcept { return rows_[slot]; }
  const ObjectRow& row(std::uint32_t slot) const noexcept { return rows_[slot]; }
  std::span<const ObjectRow> rows() const noexcept { return rows_.span(); }
  ObjectOrigin& origin(std::uint32_t slot) noexcept { return origins_[slot]; }
  const ObjectOrigin& origin(std::uint32_t slot) const noexcept { return origins_[slot]; }
  std::span<const ObjectNumber> numbers() const noexcept { return numbers_; }
  bool alive(std::uint32_t slot) const noexcept { return (marks_[slot] & alive_mark) != 0; }
  /// ObjectMark bits; the table itself keeps alive_mark and moved_mark.
  ObjectMarks& marks(std::uint32_t slot) noexcept { return marks_[slot]; }
  ObjectMarks marks(std::uint32_t slot) const noexcept { return marks_[slot]; }
  /// Who moves the object; none while nobody does.
  messages::Endpoint host(std::uint32_t slot) const noexcept { return hosts_[slot]; }
  std::span<const messages::Endpoint> hosts() const noexcept { return hosts_; }
  void set_host(std::uint32_t slot, messages::Endpoint host) noexcept { hosts_[slot] = host; }
  /// The cells whose owners have been told of the object, if notified_mark and shared_mark.
  regions::CellBox& notified_cells(std::uint32_t slot) noexcept { return notified_cells_[slot]; }
  /// Its bounds when they were, kept while the map has cuts: of cells that are cut, the parts that bounds cover count.
  geometry::Bounds& notified_bounds(std::uint32_t slot) noexcept { return notified_bounds_[slot]; }
  std::span<const geometry::Bounds> bounds() const noexcept { return bounds_.span(); }
  geometry::Bounds& bounds(std::uint32_t slot) noexcept { return bounds_[slot]; }
  /// One byte a slot: whether it holds a present object.
  std::span<const std::uint8_t> present() const noexcept { return present_; }
  /// One byte a slot: whether bounds and presence are as in the frame before.
  std::span<const std::uint8_t> resting() const noexcept { return resting_; }
  /// One byte a slot: the layer of its object; a slot that changes it is not resting.
  std::span<const std::uint8_t> layers() const noexcept { return layers_; }
  std::byte* state(std::uint32_t slot) noexcept { return states_.data() + slot * state_bytes_; }
  std::size_t state_bytes() const noexcept { return state_bytes_; }
  /// What a new host is told of the object, but for its state.
  messages::HandOverRecord hand_over(std::uint32_t slot) const noexcept;
  /// The slot of a live object, or base::NumberIndex::none.
  std::uint32_t find(ObjectNumber number) const noexcept { return index_.find(number); }
  /// The slot that a message speaks of, if it holds exactly that object; else base::NumberIndex::none.
  std::uint32_t find(const messages::ObjectRef& object) const noexcept;

  /// Fetches what a report on the object will write. A node's objects lie anywhere among the server's.
  void prefetch(std::uint32_t slot, bool with_bounds = true) const noexcept {
    if (slot < rows_.size()) {
      base::prefetch_for_write(&rows_[slot]);
      base::prefetch_for_write(&marks_[slot]);
      base::prefetch_for_read(&hosts_[slot]);
      if (with_bounds) {
        base::prefetch_for_write(&bounds_[slot]);
      }
      if (state_bytes_ != 0) {
        base::prefetch_for_write(states_.data() + slot * state_bytes_);
        base::prefetch_for_write(states_.data() + (slot + 1) * state_bytes_ - 1);
      }
    }
  }

  /// Fetches what giving it to its next host takes.
  void prefetch_host(std::uint32_t slot) const noexcept {
    base::prefetch_for_read(&rows_[slot].pose);
    base::prefetch_for_write(&marks_[slot]);
    base::prefetch_for_write(&hosts_[slot]);
  }

  /// Fetches what telling nodes of it takes.
  void prefetch_bounds(std::uint32_t slot) const noexcept {
    base::prefetch_for_write(&bounds_[slot]);
    base::prefetch_for_write(&notified_cells_[slot]);
    base::prefetch_for_write(&marks_[slot]);
    base::prefetch_for_read(&present_[slot]);
    base::prefetch_for_read(&hosts_[slot]);
  }

  /// Fetches what one of them is told.
  void prefetch_position(std::uint32_t slot) const noexcept {
    base::prefetch_for_read(&rows_[slot]);
    base::prefetch_for_read(&bounds_[slot]);
  }

  /// Makes an object and returns its slot; its model state is zero, its bounds are not set.
  std::uint32_t add(ObjectId id, const ObjectSpec& spec);
  /// Ends an object; its slot keeps its row until release_ended().
  void end(std::uint32_t slot);
  /// Ends the frame's bookkeeping: nothing has moved, and slots ended before this frame may be used again.
  void settle();

  /// Notes that pose or presence changed; keeps `present` in step with the row.
  void mark_moved(std::uint32_t slot);
  /// The same where nobody but its host has to be told.
  void mark_moved_host_only(std::uint32_t slot);
  /// Lists what has moved so far by slot, where it is so much that whoever goes through it should go through memory.
  /// Precondition: nothing has moved alone.
  void order_moved();
  /// Slots that moved, appeared or ended in this frame, each once.
  std::span<const std::uint32_t> moved() const noexcept { return moved_; }
  /// Of these, those of which perhaps others than their hosts have to be told.
  std::span<const std::uint32_t> unnotified() const noexcept { return unnotified_; }

 private:
  std::size_t state_bytes_;
  base::FlatList<ObjectRow> rows_;
  std::vector<ObjectOrigin> origins_;
  std::vector<ObjectNumber> numbers_;
  std::vector<std::uint8_t> layers_;
  std::vector<ObjectMarks> marks_;
  std::vector<messages::Endpoint> hosts_;
  base::FlatList<regions::CellBox> notified_cells_;
  base::FlatList<geometry::Bounds> notified_bounds_;
  base::FlatList<geometry::Bounds> bounds_;
  std::vector<std::uint8_t> present_;
  std::vector<std::uint8_t> resting_;
  base::FlatList<std::byte> states_;
  std::vector<std::uint32_t> free_;
  std::vector<std::uint32_t> ended_;  ///< in this frame
  std::vector<std::uint32_t> moved_, unnotified_;
  base::NumberIndex index_;
};

}  // namespace ringfence::nodes
