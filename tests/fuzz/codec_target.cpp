// Property: any bytes are either refused as a message between clients and gateway, or they are exactly one message,
// which is written again in the same bytes. A replica applies any update, or says why not. The first byte selects the
// reader.
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "fuzz/target.hpp"
#include "gateway/client/replica.hpp"
#include "gateway/protocol/client_messages.hpp"
#include "gateway/protocol/server_messages.hpp"

using namespace ringfence;
using namespace ringfence::gateway;

namespace {

using Bytes = std::vector<std::byte>;

/// Empty. Its memory is used again, so that an execution allocates less.
Bytes& scratch() {
  static Bytes bytes;
  bytes.clear();
  return bytes;
}

void check_client_message(const Bytes& bytes) {
  const ClientMessage message = read_client_message(bytes);
  std::visit(
      [&](const auto& found) {
        if constexpr (!std::is_same_v<std::decay_t<decltype(found)>, Malformed>) {
          Bytes& again = scratch();
          write(found, again);
          fuzz::require(again == bytes);
        } else {
          fuzz::require(found.reason != nullptr);
        }
      },
      message);
}

void check_update(const Bytes& bytes) {
  static Update update;
  if (!read(bytes, update)) return;
  Bytes& again = scratch();
  write(update, again);
  fuzz::require(again == bytes);
  Replica replica;
  if (replica.apply(update) != Replica::Outcome::applied) return;
  fuzz::require(replica.acknowledgement() == update.frame + 1);
  fuzz::require(replica.apply(update) == Replica::Outcome::ignored);
}

void check_shape(const Bytes& bytes) {
  ShapeId id;
  std::optional<ShapeDescription> shape;
  if (!read_shape(bytes, id, shape) || !shape.has_value()) return;
  Bytes& again = scratch();
  write_shape(id, &*shape, again);
  fuzz::require(again == bytes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  if (size == 0) return 0;
  // A copy of exactly the message's size, so that the address sanitizer detects reads beyond its end.
  const auto* const first = reinterpret_cast<const std::byte*>(input);
  const Bytes bytes(first + 1, first + size);
  switch (input[0] % 4) {
    case 0:
      check_client_message(bytes);
      break;
    case 1:
      check_update(bytes);
      break;
    case 2:
      check_shape(bytes);
      break;
    default: {
      Welcome welcome;
      Bytes& again = scratch();
      if (!read(bytes, welcome)) break;
      write(welcome, again);
      fuzz::require(again == bytes);
    }
  }
  return 0;
}
