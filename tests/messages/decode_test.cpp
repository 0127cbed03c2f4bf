#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <memory>
#include <random>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include "messages/header.hpp"
#include "messages/records.hpp"

namespace ringfence::messages {
namespace {

/// The size of a record of the protocol: its fixed part, and whether a model state follows. The table has one entry for
/// each message type, in order, and is independent of messages::record_bytes.
struct RecordSize {
  std::size_t fixed;
  bool with_state;
};
constexpr std::array<RecordSize, message_types> sizes = {{{0, false},
                                                          {sizeof(HandOverRecord), true},
                                                          {sizeof(DropRecord), false},
                                                          {sizeof(PlaceRecord), false},
                                                          {0, false},
                                                          {sizeof(StateRecord), true},
                                                          {sizeof(NodeStateRecord), true},
                                                          {sizeof(PositionRecord), false},
                                                          {sizeof(PairRecord), false},
                                                          {sizeof(CollisionRecord), false},
                                                          {sizeof(NarrowDoneRecord), false},
                                                          {sizeof(Contact), false},
                                                          {sizeof(OwnerRecord), false},
                                                          {sizeof(FrameEndRecord), false},
                                                          {sizeof(HandOverRecord), true},
                                                          {sizeof(NodeFrameStats), false},
                                                          {sizeof(RefusedRecord), false},
                                                          {sizeof(KindRecord), false},
                                                          {sizeof(CorrectRecord), false},
                                                          {sizeof(LostRecord), false},
                                                          {0, false},
                                                          {0, false},
                                                          {0, false},
                                                          {0, false},
                                                          {sizeof(ChangeRecord), false},
                                                          {sizeof(PositionRecord), false},
                                                          {sizeof(CountRecord), false},
                                                          {sizeof(CountRecord), false},
                                                          {sizeof(GhostsSentRecord), false},
                                                          {sizeof(ReplicaRecord), true},
                                                          {sizeof(QueryRecord), false},
                                                          {sizeof(QueryHitRecord), false},
                                                          {sizeof(SensedRecord), false},
                                                          {sizeof(UnlistRecord), false}}};

std::size_t size_of(std::uint16_t type, std::size_t state_bytes) {
  return sizes[type].fixed + (sizes[type].with_state ? state_bytes : 0);
}

/// A message in an allocation of exactly its size, so the address sanitizer detects every read beyond it.
struct Bytes {
  explicit Bytes(std::size_t count) : data(new std::byte[count]()), size(count) {}
  explicit Bytes(const std::vector<std::byte>& from) : Bytes(from.size()) {
    std::copy(from.begin(), from.end(), data.get());
  }
  std::span<const std::byte> span() const { return {data.get(), size}; }
  std::unique_ptr<std::byte[]> data;
  std::size_t size;
};

std::vector<std::byte> message_of(std::uint16_t type, std::size_t state_bytes, std::size_t count) {
  const std::size_t record_size = size_of(type, state_bytes);
  Header header;
  header.type = type;
  header.record_bytes = static_cast<std::uint16_t>(record_size);
  header.last = 1;
  header.source = Endpoint::user(3).value;
  header.frame = 7;
  header.count = static_cast<std::uint32_t>(count);
  header.bytes = static_cast<std::uint32_t>(sizeof(Header) + count * record_size);
  header.total = count;
  std::vector<std::byte> bytes(header.bytes);
  std::memcpy(bytes.data(), &header, sizeof header);
  for (std::size_t i = sizeof header; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::byte>(i * 37);
  }
  return bytes;
}

template <class T>
T field(std::span<const std::byte> bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

/// Whether a message is valid, computed from the byte layout instead of the struct.
bool is_valid(std::span<const std::byte> bytes, std::size_t state_bytes) {
  if (bytes.size() < 48) {
    return false;
  }
  const auto version = field<std::uint16_t>(bytes, 0);
  const auto type = field<std::uint16_t>(bytes, 2);
  const auto record_size = field<std::uint16_t>(bytes, 4);
  const auto last = field<std::uint16_t>(bytes, 6);
  const auto count = field<std::uint32_t>(bytes, 28);
  const auto complete = field<std::uint32_t>(bytes, 32);
  if (version != 2 || type == 0 || type >= message_types || last > 1 || record_size != size_of(type, state_bytes)) {
    return false;
  }
  if (record_size == 0) {
    return count == 0 && complete == 48 && bytes.size() == 48;
  }
  const std::size_t records = (bytes.size() - 48) / record_size;
  return complete == bytes.size() && count == records && records * record_size == bytes.size() - 48;
}

/// Reads all records of an accepted message. Returns the sum of their bytes, so that no read is optimised away.
unsigned read_all(const MessageView& message, std::size_t state_bytes) {
  unsigned sum = 0;
  for (std::size_t i = 0; i < message.count(); ++i) {
    const std::byte* at = message.at(i);
    const std::size_t record_size = size_of(static_cast<std::uint16_t>(message.type()), state_bytes);
    for (std::size_t k = 0; k < record_size; ++k) {
      sum += std::to_integer<unsigned>(at[k]);
    }
  }
  return sum;
}

bool accepted(const Bytes& bytes, std::size_t state_bytes) {
  MessageView message;
  const Status status = decode(bytes.span(), state_bytes, message);
  if (status != Status::ok) {
    REQUIRE(status == Status::bad_message);
    return false;
  }
  unsigned expected = 0;
  for (std::size_t i = sizeof(Header); i < bytes.size; ++i) {
    expected += std::to_integer<unsigned>(bytes.data[i]);
  }
  REQUIRE(read_all(message, state_bytes) == expected);
  return true;
}

TEST_CASE("a valid message of any type, model state size and count is accepted, and its records are read back") {
  for (std::uint16_t type = 1; type < message_types; ++type) {
    for (const std::size_t state_bytes : {0u, 8u, 64u, 256u}) {
      CHECK(record_bytes(static_cast<MessageType>(type), state_bytes) == size_of(type, state_bytes));
      for (const std::size_t count : {0u, 1u, 2u, 11u}) {
        if (size_of(type, state_bytes) == 0 && count > 0) {
          continue;
        }
        CAPTURE(type);
        CAPTURE(state_bytes);
        CAPTURE(count);
        const Bytes bytes(message_of(type, state_bytes, count));
        MessageView message;
        REQUIRE(decode(bytes.span(), state_bytes, message) == Status::ok);
        CHECK(message.count() == count);
        CHECK(message.type() == static_cast<MessageType>(type));
        CHECK(message.last());
        CHECK(message.header().frame == 7);
        CHECK(accepted(bytes, state_bytes));
      }
    }
  }
}

TEST_CASE("a message that is truncated anywhere, or longer than its header states, is refused") {
  for (std::uint16_t type = 1; type < message_types; ++type) {
    const std::vector<std::byte> complete = message_of(type, 16, size_of(type, 16) == 0 ? 0 : 3);
    for (std::size_t size = 0; size < complete.size(); ++size) {
      CAPTURE(type);
      CAPTURE(size);
      CHECK_FALSE(accepted(Bytes({complete.begin(), complete.begin() + static_cast<std::ptrdiff_t>(size)}), 16));
    }
    for (std::size_t more = 1; more <= 160; ++more) {
      std::vector<std::byte> longer = complete;
      longer.resize(complete.size() + more);
      CHECK_FALSE(accepted(Bytes(longer), 16));
    }
  }
}

TEST_CASE("a message is refused for every value of every header byte that makes it invalid") {
  for (std::uint16_t type = 1; type < message_types; ++type) {
    const std::vector<std::byte> complete = message_of(type, 24, size_of(type, 24) == 0 ? 0 : 2);
    for (std::size_t at = 0; at < sizeof(Header); ++at) {
      for (unsigned value = 0; value < 256; ++value) {
        std::vector<std::byte> changed = complete;
        changed[at] = static_cast<std::byte>(value);
        CAPTURE(type);
        CAPTURE(at);
        CAPTURE(value);
        REQUIRE(accepted(Bytes(changed), 24) == is_valid(changed, 24));
      }
    }
  }
}

TEST_CASE("a message with another world's model state size is refused") {
  for (std::uint16_t type = 1; type < message_types; ++type) {
    if (sizes[type].with_state) {
      CHECK_FALSE(accepted(Bytes(message_of(type, 32, 4)), 40));
      CHECK_FALSE(accepted(Bytes(message_of(type, 32, 4)), 0));
    }
  }
}

TEST_CASE("no random bytes make the decoder read beyond a message") {
  constexpr unsigned seed = 20261;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  unsigned accepted_count = 0;
  for (int round = 0; round < 60000; ++round) {
    CAPTURE(round);
    const std::size_t state_bytes = random() % 5 * 8;
    std::vector<std::byte> bytes(random() % 600);
    for (std::byte& byte : bytes) {
      byte = static_cast<std::byte>(random());
    }
    if (round % 2 == 0) {
      // Half of the messages are valid ones with up to three flipped bits, so that the later checks are reached too.
      const auto type = static_cast<std::uint16_t>(1 + random() % (message_types - 1));
      bytes = message_of(type, state_bytes, size_of(type, state_bytes) == 0 ? 0 : random() % 6);
      for (std::uint64_t flips = random() % 4; flips > 0; --flips) {
        bytes[random() % std::min(bytes.size(), sizeof(Header))] ^= static_cast<std::byte>(1u << random() % 8);
      }
    }
    const bool expected = is_valid(bytes, state_bytes);
    REQUIRE(accepted(Bytes(bytes), state_bytes) == expected);
    accepted_count += expected ? 1 : 0;
  }
  CHECK(accepted_count > 5000);
}

TEST_CASE("endpoints are distinct, and each has exactly one kind") {
  CHECK(Endpoint::server().is_server());
  for (const std::uint32_t number : {0u, 1u, 1023u, 65535u, 0x3ffffffeu}) {
    const Endpoint node = Endpoint::node(number);
    const Endpoint user = Endpoint::user(number);
    CHECK((node.is_node() && !node.is_user() && !node.is_server() && node.number() == number));
    CHECK((user.is_user() && !user.is_node() && !user.is_server() && user.number() == number));
    CHECK(node != user);
  }
  CHECK_FALSE(Endpoint::none().is_server());
  CHECK_FALSE(Endpoint::none().is_node());
  CHECK_FALSE(Endpoint::none().is_user());
}

}  // namespace
}  // namespace ringfence::messages
