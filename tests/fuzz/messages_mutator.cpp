// Mutates inputs of messages_target.cpp: libFuzzer changes bytes, and three times of four the header is then made to
// fit, so that the records are read.
#include <algorithm>
#include <cstring>
#include <vector>

#include "fuzz/message_repair.hpp"
#include "fuzz/target.hpp"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* bytes, std::size_t size, std::size_t most);
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* bytes, std::size_t size, std::size_t most,
                                               unsigned int seed);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* bytes, std::size_t size, std::size_t most,
                                               unsigned int seed) {
  using namespace ringfence;
  size = LLVMFuzzerMutate(bytes, size, most);
  if (seed % 4 == 0 || size == 0) return size;
  const auto* const first = reinterpret_cast<const std::byte*>(bytes);
  std::vector<std::byte> message(first + 1, first + size);
  const std::size_t state_bytes = (bytes[0] % 5) * std::size_t{8};
  fuzz::repair_message(message, state_bytes);
  if (message.size() + 1 > most) return size;
  messages::MessageView view;
  fuzz::require(messages::decode(message, state_bytes, view) == Status::ok);
  std::memcpy(bytes + 1, message.data(), message.size());
  return message.size() + 1;
}
