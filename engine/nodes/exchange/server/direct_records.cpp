#include "nodes/exchange/server/direct_records.hpp"

#include <algorithm>

namespace ringfence::nodes {

bool DirectRecords::add(NodeNumber sender, const messages::MessageView& message) {
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

std::uint64_t DirectRecords::to(NodeNumber receiver) const noexcept {
  std::uint64_t sum = 0;
  for (std::size_t sender = 0; sender < slots_; ++sender) {
    sum += counts_[sender * slots_ + receiver];
  }
  return sum;
}

void DirectRecords::remove(NodeNumber sender) noexcept {
  const auto row = counts_.begin() + static_cast<std::ptrdiff_t>(sender * slots_);
  std::fill(row, row + static_cast<std::ptrdiff_t>(slots_), 0u);
}

}  // namespace ringfence::nodes
