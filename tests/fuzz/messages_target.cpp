// Property: any bytes as a message are either refused, or all records can be read and the sizes are consistent. The
// first byte selects the size of the model state.
#include <span>
#include <vector>

#include "fuzz/target.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"

using namespace ringfence;

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
  unsigned sum = 0;
  for (std::size_t i = 0; i < message.count(); ++i) {
    for (std::size_t byte = 0; byte < each; ++byte) {
      sum += std::to_integer<unsigned>(message.at(i)[byte]);
    }
  }
  fuzz::require(sum <= 255 * bytes.size());
  fuzz::require(messages::name_of(message.type()) != nullptr);
  fuzz::require(static_cast<std::size_t>(messages::traffic_of(message.type())) < traffic_count);
  return 0;
}
