#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "messages/records.hpp"
#include "nodes/exchange/peer_lists.hpp"

namespace ringfence::nodes {

/// The objects that a CD node hands over to the other nodes of its process at the end of a frame, with their whole
/// states (M5). The next hosts read them in place.
///
/// A list is for one frame and one region map. It is made when the contacts of the frame are listed, because the states
/// are final then; so it is complete when any node may read it. If the nodes receive a new map with the end of the
/// frame, each lists again, and a reader waits for the list under its map.
///
/// Threads: one writer, the node that hosts the objects. The others read the list of their frame and map after
/// `frame_end`, each while it is inside NodeContacts::hand_over_gate. Memory: grows to the largest frame.
class HandOverList {
 public:
  void reserve(std::size_t objects, std::size_t state_bytes) {
    records_.reserve(objects);
    states_.reserve(objects * state_bytes);
  }
  /// Clears the list. `state_bytes`: bytes of model state of each object, a multiple of 8.
  void start(std::size_t state_bytes) {
    records_.clear();
    states_.clear();
    places_.clear();
    state_bytes_ = state_bytes;
  }
  /// Adds an object for `next`. `state` points to the model's state.
  void add(NodeNumber next, const messages::HandOverRecord& record, const std::byte* state);
  /// After the last add(): others may read the list. `nodes` is the number of slots.
  void finish(NodeNumber nodes, std::uint64_t frame, std::uint32_t epoch);

  /// Whether the list is that of this frame and map. If so, what the writer did before finish() is visible.
  bool is_for(std::uint64_t frame, std::uint32_t epoch) const noexcept {
    // Pairs with the store in finish().
    return stamp_.load(std::memory_order_acquire) == stamp_of(frame, epoch);
  }
  /// Positions of the objects for one node. Only if is_for().
  std::span<const std::uint32_t> of(NodeNumber next) const noexcept { return places_.of(next); }
  const messages::HandOverRecord& record(std::uint32_t place) const noexcept { return records_[place]; }
  const std::byte* state(std::uint32_t place) const noexcept { return states_.data() + place * state_bytes_; }

 private:
  // Epochs only grow, so a list of 2^32 frames ago has another one.
  static std::uint64_t stamp_of(std::uint64_t frame, std::uint32_t epoch) noexcept { return frame << 32 | epoch; }

  std::atomic<std::uint64_t> stamp_{~std::uint64_t{0}};
  base::FlatList<messages::HandOverRecord> records_;
  base::FlatList<std::byte> states_;  ///< parallel to records_
  std::size_t state_bytes_ = 0;
  PeerLists places_;
};

inline void HandOverList::add(NodeNumber next, const messages::HandOverRecord& record, const std::byte* state) {
  places_.add(next, static_cast<std::uint32_t>(records_.size()));
  records_.push_back(record);
  states_.resize(states_.size() + state_bytes_);
  std::copy_n(state, state_bytes_, states_.end() - state_bytes_);
}

inline void HandOverList::finish(NodeNumber nodes, std::uint64_t frame, std::uint32_t epoch) {
  places_.finish(nodes);
  // Pairs with the load in is_for().
  stamp_.store(stamp_of(frame, epoch), std::memory_order_release);
}

}  // namespace ringfence::nodes
