#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/numbers.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"

namespace ringfence::nodes {

/// The numbers of records of one kind that CD nodes send directly to each other in a frame, as the senders report them.
/// The server announces to each receiver how many it will get.
///
/// Threads: belongs to the server role. Memory: four bytes per pair of slots.
class DirectRecords {
 public:
  /// Sets the number of slots and clears everything.
  void start(std::size_t slots) { counts_.assign(slots * slots, 0), slots_ = slots; }
  /// Adds the counts of one sender. Returns false and adds nothing if a record names no other slot, or a slot twice.
  bool add(NodeNumber sender, const messages::MessageView& message);
  /// The sender will send one record less than it has reported. A sender that has reported too few is faulty; then
  /// nothing changes.
  void retract(NodeNumber sender, NodeNumber receiver) noexcept {
    std::uint32_t& count = counts_[sender * slots_ + receiver];
    count -= count != 0 ? 1 : 0;
  }
  /// Records for that receiver, from all senders.
  std::uint64_t to(NodeNumber receiver) const noexcept {
    std::uint64_t sum = 0;
    for (std::size_t sender = 0; sender < slots_; ++sender) {
      sum += between(static_cast<NodeNumber>(sender), receiver);
    }
    return sum;
  }
  std::uint32_t between(NodeNumber sender, NodeNumber receiver) const noexcept {
    return counts_[sender * slots_ + receiver];
  }
  /// The sender is lost after it was announced: its records do not count any more.
  void remove(NodeNumber sender) noexcept { std::fill_n(counts_.begin() + sender * slots_, slots_, 0u); }

 private:
  std::size_t slots_ = 0;
  std::vector<std::uint32_t> counts_;  ///< by sender, then by receiver
};

inline bool DirectRecords::add(NodeNumber sender, const messages::MessageView& message) {
  std::uint32_t* const row = counts_.data() + sender * slots_;
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto record = message.record<messages::CountRecord>(i);
    if (record.node >= slots_ || record.node == sender || record.count == 0 || row[record.node] != 0) {
      remove(sender);
      return false;
    }
    row[record.node] = record.count;
  }
  return true;
}

}  // namespace ringfence::nodes
