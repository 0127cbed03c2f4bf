#pragma once

#include <cstddef>
#include <cstdint>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "messages/records.hpp"
#include "nodes/exchange/peer_lists.hpp"
#include "nodes/exchange/read_gate.hpp"

namespace ringfence::nodes {

/// Ghost updates (M2) from one CD node to the other nodes of its process. They contain the positions of objects that
/// the sender hosts with host-owned states and whose bounds touch another node's region. When the bounds no longer
/// touch it, the update is a removal. This halo exchange replaces the messages node_state and position_update, which
/// pass through the server.
///
/// An object that touches several regions has one record, however many nodes receive it.
///
/// Threads: one writer, the CD node that hosts the objects. It fills the updates of a frame before it reports to the
/// server that it has moved everything, and does not change them until the next `frame_begin`. The other nodes read the
/// updates after the server has announced that all positions of the frame are sent. Each reads them while it is inside
/// its own gate. Memory: grows to the largest frame.
class GhostUpdates {
 public:
  /// One update for one node. The record lives until the next start().
  struct Update {
    const messages::PositionRecord* record;
    bool gone;  ///< the object no longer touches the receiver's region
  };

  /// Call it before the first frame. Reserves for this many objects.
  void reserve(std::size_t objects) { records_.reserve(objects), entries_.reserve(objects); }
  /// Clears the updates and starts the frame.
  void start(std::uint64_t frame) {
    frame_ = frame;
    records_.clear();
    entries_.clear();
  }
  /// Adds a record. Its flags are flag_present and, if the sender remains the host, flag_keeps_host. The add_receiver()
  /// calls that follow refer to this record.
  void add(const messages::PositionRecord& record) {
    messages::PositionRecord& added = records_.add();
    // The line may be in the cache of a core that read it in the frame before.
    base::prefetch_for_write(&added + records_ahead);
    added = record;
  }
  /// Adds a receiver of the last record. At most once for each node and record.
  void add_receiver(NodeNumber peer, bool gone) {
    entries_.add(peer, static_cast<std::uint32_t>(records_.size() - 1) | (gone ? gone_bit : 0));
  }
  /// Call it after the last record of a frame, before the updates are read. `nodes` is the number of nodes.
  void finish(NodeNumber nodes) { entries_.finish(nodes); }

  /// The frame of the updates; 2^64 - 1 before the first start().
  std::uint64_t frame() const noexcept { return frame_; }
  /// Appends the updates for `peer` to a list, each object once. Reads no record. Only after finish().
  void list(NodeNumber peer, base::FlatList<Update>& to) const {
    for (const std::uint32_t entry : entries_.of(peer)) {
      to.push_back({&records_[entry & ~gone_bit], (entry & gone_bit) != 0});
    }
  }
  /// Prefetches a record for reading.
  static void prefetch(const messages::PositionRecord& record) noexcept {
    base::prefetch_for_read(&record);
    base::prefetch_for_read(reinterpret_cast<const std::byte*>(&record + 1) - 1);
  }
  /// Calls visit(peer) for each node that has an update. Only after finish().
  template <class Visit>
  void each_receiver(Visit visit) const {
    entries_.each_peer(visit);
  }
  /// Number of updates for all receivers together. Only after finish().
  std::size_t size() const noexcept { return entries_.size(); }

  ReadGate gate;  ///< the owner of these updates enters it to read those of the other nodes

 private:
  static constexpr std::uint32_t gone_bit = 0x80000000u;
  static constexpr std::uint64_t no_frame = ~std::uint64_t{0};
  static constexpr std::ptrdiff_t records_ahead = 4;

  std::uint64_t frame_ = no_frame;
  base::FlatList<messages::PositionRecord> records_;
  PeerLists entries_;  ///< record index, with gone_bit
};

}  // namespace ringfence::nodes
