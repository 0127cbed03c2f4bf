#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "messages/header.hpp"

namespace ringfence::fuzz {

/// Makes any bytes a message that decode() accepts, with as many of their records as fit; so that mutations reach what
/// is behind the checks of the header. All other fields of the header, and the records, stay as they are.
inline void repair_message(std::vector<std::byte>& bytes, std::size_t state_bytes) {
  messages::Header header;
  bytes.resize(std::max(bytes.size(), sizeof header));
  std::memcpy(&header, bytes.data(), sizeof header);
  header.version = messages::protocol_version;
  header.type = static_cast<std::uint16_t>(1 + header.type % (messages::message_types - 1));
  const std::size_t each = messages::record_bytes(static_cast<messages::MessageType>(header.type), state_bytes);
  header.record_bytes = static_cast<std::uint16_t>(each);
  header.count = each == 0 ? 0 : static_cast<std::uint32_t>((bytes.size() - sizeof header) / each);
  header.bytes = static_cast<std::uint32_t>(sizeof header + header.count * each);
  header.last &= 1;
  if (header.last == 0) header.total = 0;
  header.total = std::max<std::uint64_t>(header.total, header.last == 0 ? 0 : header.count);
  bytes.resize(header.bytes);
  std::memcpy(bytes.data(), &header, sizeof header);
}

}  // namespace ringfence::fuzz
