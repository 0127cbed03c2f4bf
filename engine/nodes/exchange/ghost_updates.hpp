#pragma once

#include <cstddef>
#include <cstdint>

#include "base/flat_list.hpp"
#include "base/prefetch.hpp"
#include "messages/records.hpp"
#include "nodes/exchange/peer_lists.hpp"
#include "nodes/exchange/read_gate.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// Ghost updates (M2) from one CD node to the other nodes of its process: positions of the objects that it hosts with
/// host-owned states and whose bounds touch another node's region, and removals when they no longer do. This halo
/// exchange replaces the way through the server (node_state, then position_update).
///
/// An object near a corner has one record, however many nodes receive it.
///
/// Threads: one writer. It fills the updates of a frame before it reports to the server that it has moved everything,
/// and does not change them until the next `frame_begin`. The other nodes read them, through their gates, after the
/// server has sent them its own positions. Memory: grows to the largest frame.
class GhostUpdates {
 public:
  /// One update for one node. The record lives until the next start().
  struct Update {
    const messages::PositionRecord* record;
    bool gone;  ///< the object no longer touches the receiver's region
  };

  /// Call it before the first frame. Reserves for this many objects.
  void reserve(std::size_t objects);
  /// Clears the updates and starts the frame.
  void start(std::uint64_t frame);
  /// Adds a record with the flags present and keeps_host; the following add_receiver() calls refer to it.
  void add(const messages::PositionRecord& record) {
    messages::PositionRecord& added = records_.add();
    base::prefetch_for_write(&added +
                             records_ahead);  // the line may be in the cache of a core that read it in the frame before
    added = record;
  }
  void add_receiver(NodeNumber peer, bool gone) {
    entries_.add(peer, static_cast<std::uint32_t>(records_.size() - 1) | (gone ? gone_bit : 0));
  }
  /// Call it after the last record. `nodes` is the number of nodes.
  void finish(NodeNumber nodes) { entries_.finish(nodes); }

  std::uint64_t frame() const noexcept { return frame_; }
  /// Appends the updates for `peer` to a list, each object once, without reading the records.
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
  /// Number of updates, all receivers together.
  std::size_t size() const noexcept { return entries_.size(); }

  ReadGate gate;  ///< of the owner of these updates, for reading those of the other nodes

 private:
  static constexpr std::uint32_t gone_bit = 0x80000000u;
  static constexpr std::uint64_t no_frame = ~std::uint64_t{0};
  static constexpr std::ptrdiff_t records_ahead = 4;

  std::uint64_t frame_ = no_frame;
  base::FlatList<messages::PositionRecord> records_;
  PeerLists entries_;  ///< record index, with gone_bit
};

}  // namespace ringfence::nodes
