#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/frame_stamp.hpp"
#include "base/number_index.hpp"
#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "broad_phase/layers.hpp"
#include "geometry/bounds.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "nodes/exchange/object_row.hpp"
#include "regions/region_map.hpp"
#include "ringfence/object.hpp"

namespace ringfence::nodes {

/// State bits of an object.
using ObjectMarks = std::uint16_t;
enum ObjectMark : ObjectMarks {
  alive_mark = 1,
  notified_mark = 2,    ///< nodes have received the object; which ones: ObjectTable::notified_cells(), if shared_mark
  shared_mark = 4,      ///< other nodes than its host may have received it; otherwise only the host knows it
  moved_mark = 8,       ///< listed in moved()
  reported_mark = 16,   ///< this frame's state came from the CD node that hosts it
  inner_mark = 32,      ///< reported with reported_mark: its bounds touch only cells of the reporting node
  recovered_mark = 64,  ///< host lost; held by the server until the next cut
  host_changed_mark = 128,  ///< moved from one host to another at this cut
  host_owned_mark = 256,  ///< its host keeps its states and sends ghost updates to the other nodes: row, state, bounds
                          ///< and notified cells here may be of an earlier frame
  avatar_mark = 512,      ///< its category is avatar
  jumped_mark = 1024,     ///< it was placed at its last new pose; undefined while host_owned_mark is set
  no_state_mark =
      2048  ///< the model's state is not in the table, but in the memory of the CD node that hosts the object
};

/// What is read of the objects of a contact, by slot; the spans are parallel. Numbers and marks are small enough for
/// the second-level cache at 64,000 objects.
struct ContactObjects {
  std::span<const ObjectRow> rows;
  std::span<const ObjectOrigin> origins;
  std::span<const ObjectNumber> numbers;
  std::span<const ObjectMarks> marks;

  /// Prefetches number and marks.
  void prefetch(std::uint32_t slot) const noexcept {
    base::prefetch_for_read(numbers.data() + slot);
    base::prefetch_for_read(marks.data() + slot);
  }
};

/// The server's table of objects, by slot. A slot belongs to one object from its spawn to the frame after its end.
///
/// Fields that are read at random for every pair and contact (numbers, layers, hosts, marks) are separate arrays, small
/// enough for the second-level cache at 64,000 objects. Fields that are read together form rows of one cache line.
///
/// Threads: belongs to the server role during a frame, to the facade between frames. Memory: reserved; grows at spawns.
class ObjectTable {
 public:
  /// `state_bytes`: size of the model's state, a multiple of 8.
  ObjectTable(std::size_t objects, std::size_t state_bytes);

  /// Number of slots in use or used before; the size of all spans.
  std::size_t slots() const noexcept { return rows_.size(); }
  std::size_t live() const noexcept { return index_.size(); }
  const ObjectRow& row(std::uint32_t slot) const noexcept { return rows_[slot]; }
  std::span<const ObjectRow> rows() const noexcept { return rows_.span(); }
  /// The row, to change it in this frame.
  ObjectRow& change_row(std::uint32_t slot) noexcept {
    changed_[slot] = frame_;
    return rows_[slot];
  }
  /// By slot: the last frame in which its row, its group or jumped_mark has changed. An object that is in the memory of
  /// its host changes there: see RegionObjects::changed().
  std::span<const base::FrameStamp> changed() const noexcept { return changed_; }
  ObjectOrigin& origin(std::uint32_t slot) noexcept { return origins_[slot]; }
  const ObjectOrigin& origin(std::uint32_t slot) const noexcept { return origins_[slot]; }
  std::span<const ObjectOrigin> origins() const noexcept { return origins_; }
  std::span<const ObjectNumber> numbers() const noexcept { return numbers_; }
  ContactObjects contact_objects() const noexcept { return {rows(), origins(), numbers(), marks_}; }
  bool alive(std::uint32_t slot) const noexcept { return (marks_[slot] & alive_mark) != 0; }
  /// ObjectMark bits; the table itself maintains alive_mark and moved_mark.
  ObjectMarks& marks(std::uint32_t slot) noexcept { return marks_[slot]; }
  ObjectMarks marks(std::uint32_t slot) const noexcept { return marks_[slot]; }
  std::span<const ObjectMarks> marks() const noexcept { return marks_; }
  /// Sets or clears jumped_mark.
  void set_jumped(std::uint32_t slot, bool jumped) noexcept {
    marks_[slot] = static_cast<ObjectMarks>((marks_[slot] & ~jumped_mark) | (jumped ? jumped_mark : 0));
    changed_[slot] = frame_;
  }
  /// The object's host; none if it has none.
  messages::Endpoint host(std::uint32_t slot) const noexcept { return hosts_[slot]; }
  std::span<const messages::Endpoint> hosts() const noexcept { return hosts_; }
  void set_host(std::uint32_t slot, messages::Endpoint host) noexcept { hosts_[slot] = host; }
  /// The cells whose owners have received the object, if notified_mark and shared_mark are set.
  regions::CellBox& notified_cells(std::uint32_t slot) noexcept { return notified_cells_[slot]; }
  /// The object's bounds at that time: in divided cells of the map only the parts that the bounds cover count.
  /// Precondition: keep_notified_bounds() was called.
  geometry::Bounds& notified_bounds(std::uint32_t slot) noexcept { return notified_bounds_[slot]; }
  /// From now on these bounds are kept; until then nothing is allocated for them. They begin as the present bounds:
  /// when a map divides cells for the first time, no node has an object by that map yet.
  void keep_notified_bounds();
  std::span<const geometry::Bounds> bounds() const noexcept { return bounds_.span(); }
  geometry::Bounds& bounds(std::uint32_t slot) noexcept { return bounds_[slot]; }
  /// One byte per slot: whether it holds a present object.
  std::span<const std::uint8_t> present() const noexcept { return present_; }
  /// One byte per slot: whether bounds and presence are as in the frame before.
  std::span<const std::uint8_t> resting() const noexcept { return resting_; }
  /// One byte per slot: the layer of its object, with broad_phase::fixed_object if it is static. When it changes, the
  /// slot is not resting.
  std::span<const std::uint8_t> layers() const noexcept { return layers_; }
  /// The group of a slot's object; 0: none.
  std::uint32_t group(std::uint32_t slot) const noexcept { return has_groups_ ? groups_[slot] : 0; }
  /// The groups of all slots; empty as long as no object has had one.
  std::span<const std::uint32_t> groups() const noexcept {
    return has_groups_ ? std::span<const std::uint32_t>(groups_) : std::span<const std::uint32_t>();
  }
  /// The crowd of a slot's object (broad_phase/crowds.hpp); 0: none.
  std::uint32_t crowd(std::uint32_t slot) const noexcept { return has_crowds_ ? crowds_[slot] : 0; }
  /// The crowds of all slots; empty as long as no object has had one.
  std::span<const std::uint32_t> crowds() const noexcept {
    return has_crowds_ ? std::span<const std::uint32_t>(crowds_) : std::span<const std::uint32_t>();
  }
  /// The model's state. Precondition: not no_state_mark.
  const std::byte* state(std::uint32_t slot) const noexcept { return states_.data() + slot * state_bytes_; }
  /// Where the caller writes the whole state. Clears no_state_mark.
  std::byte* new_state(std::uint32_t slot) noexcept {
    marks_[slot] = static_cast<ObjectMarks>(marks_[slot] & ~no_state_mark);
    return states_.data() + slot * state_bytes_;
  }
  /// Between frames: sets no_state_mark for all objects that CD nodes host, and gives the memory of their states and of
  /// the lists of moved objects back to the system. Precondition: moved() is empty.
  void release_states_of_nodes() noexcept;
  std::size_t state_bytes() const noexcept { return state_bytes_; }
  /// The hand-over record for a new host, without the model's state.
  messages::HandOverRecord hand_over(std::uint32_t slot) const noexcept;
  /// The slot of a live object, or base::NumberIndex::none.
  std::uint32_t find(ObjectNumber number) const noexcept { return index_.find(number); }
  /// The slot of a reference in a message, if it still holds that object; otherwise base::NumberIndex::none.
  std::uint32_t find(const messages::ObjectRef& object) const noexcept;

  /// Prefetches what a state report for the object writes.
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

  /// Prefetches what a change of host accesses.
  void prefetch_host(std::uint32_t slot) const noexcept {
    base::prefetch_for_write(&marks_[slot]);
    base::prefetch_for_write(&hosts_[slot]);
  }

  /// Prefetches what Dispatch accesses to list the object.
  void prefetch_bounds(std::uint32_t slot) const noexcept {
    base::prefetch_for_write(&bounds_[slot]);
    base::prefetch_for_write(&notified_cells_[slot]);
    base::prefetch_for_write(&marks_[slot]);
    base::prefetch_for_read(&present_[slot]);
    base::prefetch_for_read(&hosts_[slot]);
  }

  /// Prefetches what a position record reads.
  void prefetch_position(std::uint32_t slot) const noexcept {
    base::prefetch_for_read(&rows_[slot]);
    base::prefetch_for_read(&origins_[slot]);
    base::prefetch_for_read(&bounds_[slot]);
  }

  /// Adds an object and returns its slot; its model state is zero, its bounds are not set.
  std::uint32_t add(ObjectId id, const ObjectSpec& spec);
  /// Change an object from this frame on. Its bounds are not set. Groups and crowds are stored from the first that is
  /// not 0 on.
  void set_group(std::uint32_t slot, std::uint32_t group);
  void set_crowd(std::uint32_t slot, std::uint32_t crowd);
  void set_layer(std::uint32_t slot, std::uint8_t layer) noexcept;
  void set_shape(std::uint32_t slot, ShapeNumber shape) noexcept { change_row(slot).shape = shape; }
  /// Ends an object; its slot keeps its row until the next settle().
  void end(std::uint32_t slot);
  /// From now on changes are those of that frame.
  void begin_frame(std::uint64_t frame) noexcept { frame_ = base::stamp_of(frame); }
  /// Ends the frame's bookkeeping: moved() becomes empty, and slots that ended before this frame may be reused.
  void settle();

  /// Marks a change of pose or presence; updates present().
  void mark_moved(std::uint32_t slot);
  /// The same for a change of which only the host needs to know.
  void mark_moved_host_only(std::uint32_t slot) {
    present_[slot] = (rows_[slot].object.flags & messages::flag_present) != 0 ? 1 : 0;
    resting_[slot] = 0;
    if ((marks_[slot] & moved_mark) == 0) {
      marks_[slot] |= moved_mark;
      moved_.push_back(slot);
    }
  }
  /// Sorts moved() by slot if there are enough entries that a pass in memory order is cheaper. Precondition: no
  /// mark_moved_host_only() in this frame.
  void order_moved();
  /// The nodes whose regions these bounds touch have received the object from its host; without `shared` only the host
  /// knows it. Sets its bounds.
  void note_notified(std::uint32_t slot, const geometry::Bounds& bounds, const regions::CellGrid& grid, bool shared);
  /// Slots that moved, appeared or ended in this frame, each once.
  std::span<const std::uint32_t> moved() const noexcept { return moved_.span(); }
  /// Those of moved() that nodes other than the host may need.
  std::span<const std::uint32_t> unnotified() const noexcept { return unnotified_.span(); }

 private:
  template <class Visit>
  void each_list(Visit visit);

  std::size_t state_bytes_;
  base::FlatList<ObjectRow> rows_;
  std::vector<base::FrameStamp> changed_;
  base::FrameStamp frame_ = 0;
  std::vector<ObjectOrigin> origins_;
  std::vector<ObjectNumber> numbers_;
  std::vector<std::uint8_t> layers_;
  std::vector<std::uint32_t> groups_;  ///< empty without has_groups_
  bool has_groups_ = false;            ///< an object had a group
  std::vector<std::uint32_t> crowds_;  ///< empty without has_crowds_
  bool has_crowds_ = false;            ///< an object had a crowd
  std::vector<ObjectMarks> marks_;
  std::vector<messages::Endpoint> hosts_;
  base::FlatList<regions::CellBox> notified_cells_;
  base::FlatList<geometry::Bounds> notified_bounds_;  ///< empty before keep_notified_bounds()
  bool keeps_notified_bounds_ = false;
  base::FlatList<geometry::Bounds> bounds_;
  std::vector<std::uint8_t> present_;
  std::vector<std::uint8_t> resting_;
  base::FlatList<std::byte> states_;
  std::vector<std::uint32_t> free_;
  std::vector<std::uint32_t> ended_;  ///< in this frame
  base::FlatList<std::uint32_t> moved_, unnotified_;
  base::NumberIndex index_;
};

}  // namespace ringfence::nodes
