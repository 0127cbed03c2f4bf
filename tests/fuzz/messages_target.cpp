// Property: any bytes as a message are either refused, or all records can be read and the sizes are consistent; and if
// the records are valid too, as they must be between processes, their indices are within the limits of the world. The
// first byte selects the size of the model state.
#include <cstring>
#include <span>
#include <vector>

#include "fuzz/target.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "nodes/message_check.hpp"

using namespace ringfence;

namespace {

constexpr nodes::MessageLimits limits{.nodes = 3, .shapes = 2, .slots = 64};

/// Precondition: the records are valid.
void check_indices(const messages::MessageView& message) {
  using messages::MessageType;
  for (std::size_t i = 0; i < message.count(); ++i) {
    switch (message.type()) {
      case MessageType::hand_over:
      case MessageType::adopt:
        fuzz::require(message.record<messages::HandOverRecord>(i).object.slot < limits.slots);
        break;
      case MessageType::node_state:
        fuzz::require(message.record<messages::NodeStateRecord>(i).object.slot < limits.slots);
        break;
      case MessageType::replica:
        fuzz::require(message.record<messages::ReplicaRecord>(i).slot < limits.slots);
        break;
      case MessageType::position_update:
      case MessageType::ghost:
        fuzz::require(message.record<messages::PositionRecord>(i).object.slot < limits.slots);
        break;
      default:
        break;
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::size_t state_bytes = (input[0] % 5) * std::size_t{8};
  // A copy of exactly the message's size, so that the address sanitizer detects reads beyond its end.
  const auto* const first = reinterpret_cast<const std::byte*>(input);
  const std::vector<std::byte> bytes(first + 1, first + size);
  messages::MessageView message;
  const Status status = messages::decode(bytes, state_bytes, message);
  fuzz::require(status == Status::ok || status == Status::bad_message);
  if (status != Status::ok) {
    return 0;
  }
  const std::size_t each = messages::record_bytes(message.type(), state_bytes);
  fuzz::require(sizeof(messages::Header) + message.count() * each == bytes.size());
  // Copies, because libFuzzer notes each comparison of a loop over bytes.
  std::vector<std::byte> records(bytes.size());
  for (std::size_t i = 0; i < message.count(); ++i) {
    std::memcpy(records.data() + i * each, message.at(i), each);
  }
  fuzz::require(std::memcmp(records.data(), bytes.data() + sizeof(messages::Header), message.count() * each) == 0);
  fuzz::require(messages::name_of(message.type()) != nullptr);
  fuzz::require(static_cast<std::size_t>(messages::traffic_of(message.type())) < traffic_count);
  if (nodes::is_valid(message, limits)) {
    check_indices(message);
  }
  return 0;
}
