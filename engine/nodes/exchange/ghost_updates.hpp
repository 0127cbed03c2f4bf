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

/// What a CD node tells the others of its process of the objects that it hosts and whose states it keeps from the
/// server: where they stand, if they touch the others' regions, or that they do so no more. M2 from node to node, in
/// place of states to the server and positions from there: a halo exchange, as domain decomposition has it.
///
/// An object near a corner is one record, however many nodes are told of it.
///
/// Threads: one writer. It fills a frame's halo before it tells the server that it has moved all, and leaves it as it
/// is until the next `frame_begin`; those that their gates let in read it when the server has sent them the positions
/// that it knows. Memory: grows to the largest frame.
class GhostUpdates {
 public:
  /// What one node is told of one object. The record is as it is as long as the halo.
  struct Update {
    const messages::PositionRecord* record;
    bool gone;  ///< it touches the receiver's region no more
  };

  /// Before the first frame: for so many objects.
  void reserve(std::size_t objects);
  /// Empties it for the frame.
  void start(std::uint64_t frame);
  /// One more record, with the flags present and staying; the tell() that follow are of it.
  void add(const messages::PositionRecord& record) {
    messages::PositionRecord& added = records_.add();
    base::prefetch_for_write(&added +
                             records_ahead);  // another core's cache may have it, whose node read what was there
    added = record;
  }
  void add_receiver(NodeNumber peer, bool gone) {
    entries_.add(peer, static_cast<std::uint32_t>(records_.size() - 1) | (gone ? gone_bit : 0));
  }
  /// After the last of them; `nodes` is how many there are.
  void finish(NodeNumber nodes) { entries_.finish(nodes); }

  std::uint64_t frame() const noexcept { return frame_; }
  /// Adds what `peer` is told to a list, each object once, without a look at the records.
  void list(NodeNumber peer, base::FlatList<Update>& to) const {
    for (const std::uint32_t entry : entries_.of(peer)) {
      to.push_back({&records_[entry & ~gone_bit], (entry & gone_bit) != 0});
    }
  }
  /// Fetches a record to read it.
  static void prefetch(const messages::PositionRecord& record) noexcept {
    base::prefetch_for_read(&record);
    base::prefetch_for_read(reinterpret_cast<const std::byte*>(&record + 1) - 1);
  }
  /// To all nodes together.
  std::size_t size() const noexcept { return entries_.size(); }

  ReadGate gate;  ///< of the node that this is the halo of, to the halos of the others

 private:
  static constexpr std::uint32_t gone_bit = 0x80000000u;
  static constexpr std::uint64_t no_frame = ~std::uint64_t{0};
  static constexpr std::ptrdiff_t records_ahead = 4;

  std::uint64_t frame_ = no_frame;
  base::FlatList<messages::PositionRecord> records_;
  PeerLists entries_;  ///< which of records_, with gone_bit
};

}  // namespace ringfence::nodes
