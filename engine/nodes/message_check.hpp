#pragma once

#include <cstdint>
#include <limits>

#include "messages/header.hpp"
#include "messages/records.hpp"

namespace ringfence::nodes {

/// Upper limits for numbers in the messages of one world.
struct MessageLimits {
  std::uint32_t nodes = 0;                                          ///< number of CD nodes
  std::uint32_t shapes = 0;                                         ///< number of shapes that the receiver has now
  std::uint32_t slots = std::numeric_limits<std::uint32_t>::max();  ///< number of object slots
};

/// Whether the protocol allows every index, enumerator, count and coordinate in the records of a decoded message, as
/// far as this does not depend on the receiver's state. The receiver checks the rest: whether the message may arrive
/// now, and whether its objects are known.
///
/// Call it for messages from another process. Roles of the same process are trusted, so their messages are not checked.
/// Any thread may call it. Cost: a few nanoseconds a record.
bool is_valid(const messages::MessageView& message, const MessageLimits& limits) noexcept;

/// Whether CD nodes send each other messages of this type.
constexpr bool is_between_nodes(messages::MessageType type) noexcept {
  return type == messages::MessageType::hand_over || type == messages::MessageType::ghost ||
         type == messages::MessageType::notify;
}

}  // namespace ringfence::nodes
