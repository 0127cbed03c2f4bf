#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <span>
#include <type_traits>

#include "ringfence/frame_report.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/status.hpp"

namespace ringfence::messages {

/// Every message of the protocol: one header and a run of equal, fixed-size records. See docs/protocol.md.
enum class MessageType : std::uint16_t {
  // Server to hosts, before a frame.
  adopt = 1,        ///< HandOverRecord + model state: host this object from now on (spawn, or its host is gone)
  drop = 2,         ///< DropRecord: the object was destroyed, or is hosted elsewhere from now on
  place = 3,        ///< PlaceRecord: the object stands here now
  frame_begin = 4,  ///< no records: move for frame Header::frame
  // Hosts to server.
  state_update = 5,  ///< M1, user node to server: StateRecord + model state of what changed
  node_state = 6,    ///< CD node to server: NodeStateRecord + model state of what changed
  // Server to CD nodes.
  position_update = 7,  ///< M2: PositionRecord of each object that moved into, in or out of the node's region
  pairs = 8,            ///< M2: PairRecord of each candidate that the node owns (broad phase on the server)
  // CD nodes to server.
  collision = 9,     ///< M3: CollisionRecord of each pair in contact, in order of (a, b)
  narrow_done = 10,  ///< NarrowDoneRecord: everything owned has been tested
  // Server to hosts, after the narrow phase.
  confirm = 18,  ///< M4, to CD nodes that host: ConfirmRecord of each 64 contacts that the receiver found itself
  notify = 11,   ///< M4: Contact of each other contact that concerns the receiver, in order of (a, b), ended ones too
  region_map = 12,  ///< OwnerRecord: a new region map, cells in order
  frame_end = 13,   ///< FrameEndRecord, to CD nodes: all contacts sent; this many hand-overs will reach you
  // CD node to CD node.
  hand_over = 14,  ///< M5: HandOverRecord + model state: hosting and duty for an object
  // CD nodes to server.
  kinds = 17,  ///< KindRecord of each two kinds of shapes that the node tested
  // All to server.
  frame_done = 15,  ///< to the server: the frame is complete here; a NodeFrameStats
  // Server to user nodes.
  refused = 16,  ///< RefusedRecord: what of the receiver's messages was refused, and why
  // Server to CD nodes, when one of them has stopped answering, or may have.
  lost = 19,   ///< LostRecord: that node is no longer there; a region_map follows where the frame is detected anew
  probe = 20,  ///< no records: answer that you are there
  // CD nodes to server.
  probe_reply = 21,  ///< no records: the answer
  published = 22,    ///< no records: what the sender hosts can be read in its publication
  // Server to user nodes, while CD nodes test.
  read_publications = 23,  ///< no records: all that is published of this frame can be read
};
inline constexpr std::uint16_t message_types = 24;

/// The kind of traffic that a message counts as.
Traffic traffic_of(MessageType type) noexcept;
const char* name_of(MessageType type) noexcept;

inline constexpr std::uint16_t protocol_version = 1;

/// Who speaks: the server, a CD node or a user node.
struct Endpoint {
  std::uint32_t value = 0;

  static constexpr Endpoint server() noexcept { return {0}; }
  static constexpr Endpoint node(NodeNumber node) noexcept { return {0x40000000u | node}; }
  static constexpr Endpoint user(UserNumber user) noexcept { return {0x80000000u | user}; }
  static constexpr Endpoint none() noexcept { return {0xffffffffu}; }
  constexpr bool is_server() const noexcept { return value == 0; }
  constexpr bool is_node() const noexcept { return (value & 0xc0000000u) == 0x40000000u; }
  constexpr bool is_user() const noexcept { return (value & 0xc0000000u) == 0x80000000u; }
  constexpr std::uint32_t number() const noexcept { return value & 0x3fffffffu; }
  constexpr bool operator==(const Endpoint&) const noexcept = default;
};

/// Stands before the records of every message. Little-endian; 48 bytes; a message is 8-byte aligned.
struct Header {
  std::uint16_t version = protocol_version;
  std::uint16_t type = 0;
  std::uint16_t record_bytes = 0;  ///< of one record, a multiple of 8; model state included
  std::uint16_t last = 0;          ///< 1: the run ends here, and `total` says how many records it had
  std::uint32_t source = 0;        ///< Endpoint
  std::uint32_t destination = 0;   ///< Endpoint
  std::uint64_t frame = 0;
  std::uint32_t epoch = 0;  ///< of the region map that the sender works under
  std::uint32_t count = 0;  ///< records in this message
  std::uint32_t bytes = 0;  ///< of the whole message: sizeof(Header) + count * record_bytes
  std::uint32_t reserved = 0;
  std::uint64_t total = 0;  ///< records of the whole run, where `last` is 1
};
static_assert(sizeof(Header) == 48 && std::is_trivially_copyable_v<Header>);

/// A message that has been checked: sizes, version, type and count are what they must be; its records are not checked.
class MessageView {
 public:
  const Header& header() const noexcept { return header_; }
  MessageType type() const noexcept { return static_cast<MessageType>(header_.type); }
  std::size_t count() const noexcept { return header_.count; }
  bool last() const noexcept { return header_.last != 0; }

  /// A copy of record i's fixed part. Precondition: i < count().
  template <class Record>
  Record record(std::size_t i) const noexcept {
    Record record;
    std::memcpy(&record, at(i), sizeof(Record));
    return record;
  }
  /// The same where it lies, for as long as the message is there. What is copied as a whole and then read in other
  /// parts waits for all that was written before it.
  template <class Record>
  const Record& view(std::size_t i) const noexcept {
    static_assert(alignof(Record) <= 8 && std::is_trivially_copyable_v<Record>);
    return *std::launder(reinterpret_cast<const Record*>(at(i)));
  }
  const std::byte* at(std::size_t i) const noexcept { return records_ + i * header_.record_bytes; }
  /// What follows the fixed part of record i: the model's state.
  template <class Record>
  const std::byte* state(std::size_t i) const noexcept {
    return at(i) + sizeof(Record);
  }

 private:
  friend Status decode(std::span<const std::byte> bytes, std::size_t state_bytes, MessageView& out) noexcept;
  Header header_;
  const std::byte* records_ = nullptr;
};

/// Checks a message as it came off a link. Trusts nothing: version, type, record size for that type, count and length
/// must fit each other. `state_bytes` is the model state of this world, rounded up to 8.
/// Returns ok and fills `out`, whose records live as long as `bytes`; or bad_message.
Status decode(std::span<const std::byte> bytes, std::size_t state_bytes, MessageView& out) noexcept;

/// Bytes of one record of that type in a world whose models keep `state_bytes` (a multiple of 8).
std::size_t record_bytes(MessageType type, std::size_t state_bytes) noexcept;

}  // namespace ringfence::messages
