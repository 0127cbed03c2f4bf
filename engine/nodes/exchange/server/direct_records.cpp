#include "nodes/exchange/server/direct_records.hpp"

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

}  // namespace ringfence::nodes
