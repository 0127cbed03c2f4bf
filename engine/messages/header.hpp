#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <span>
#include <type_traits>

#include "base/numbers.hpp"
#include "ringfence/frame_report.hpp"
#include "ringfence/status.hpp"

namespace ringfence::messages {

/// The message types of the protocol. A message is a header and a number of records of equal size. A run is a sequence
/// of messages of one type; the last message of a run is marked. See docs/protocol.md.
enum class MessageType : std::uint16_t {
  // Server to hosts, before a frame.
  adopt = 1,        ///< HandOverRecord + model state: host this object from now on (it is new, or its host is gone)
  drop = 2,         ///< DropRecord: the object was destroyed, or another role hosts it from now on
  place = 3,        ///< PlaceRecord: the object has this pose now, or is absent
  frame_begin = 4,  ///< no records: move the hosted objects for frame Header::frame; sent to all roles
  // Hosts to server.
  state_update = 5,  ///< M1, user node to server: StateRecord + model state of each object that changed
  node_state = 6,    ///< CD node to server: NodeStateRecord + model state of each object that changed
  /// CD node to server, instead: ReplicaRecord + model state of each object whose state was and is host-owned, if the
  /// two share no memory; before the end of node_state.
  replica = 29,
  // Server to CD nodes.
  query = 30,  ///< QueryRecord of each query of the frame, if any; before frame_begin
  /// SensedRecord of each object of the frame before that the models of the receiver's objects may sense, if any;
  /// before
  /// frame_begin.
  sensed = 32,
  position_update = 7,  ///< M2: PositionRecord of each object that moved into, within or out of the node's region
  pairs = 8,            ///< M2: PairRecord of each candidate that the node owns (broad phase on the server only)
  // CD nodes to server.
  collision = 9,     ///< M3: CollisionRecord of each pair in contact, ordered by (a, b)
  change = 24,       ///< M3: ChangeRecord of each contact that began or ended at the sender
  narrow_done = 10,  ///< NarrowDoneRecord: the node has tested all pairs that it owns
  // Server to hosts, after the narrow phase.
  /// M4, to CD nodes: a CorrectRecord for each contact that the receiver reported as begun and that persists.
  correct = 18,
  /// M4, to CD nodes, before `correct`: an UnlistRecord for each contact that the receiver found and that is not in the
  /// list of contacts.
  unlist = 33,
  /// M4: a Contact for each other contact of the objects that the receiver hosts, ordered by (a, b). User nodes also
  /// receive the ended contacts.
  notify = 11,
  region_map = 12,  ///< OwnerRecord of each table entry: a new region map
  frame_end = 13,   ///< FrameEndRecord, to CD nodes: phases are final; expect these numbers of records from nodes
  // CD node to CD node. Between nodes of different processes these go directly. `notify` also: a Contact for each
  // contact of an object that the receiver hosts in the next frame.
  hand_over = 14,  ///< M5: HandOverRecord + model state: the receiver hosts this object from the next frame on
  /// M2: PositionRecord of each hosted object that moved into, within or out of the receiver's region.
  ghost = 25,
  // CD nodes to server: numbers of records for other nodes, so that the server can announce them to the receivers.
  ghost_counts = 26,    ///< CountRecord of each receiver of `ghost`; before the end of node_state
  contact_counts = 27,  ///< CountRecord of each receiver of `notify`; before narrow_done
  // Server to CD nodes, before the end of position_update.
  ghosts_sent = 28,  ///< GhostsSentRecord: expect this number of ghosts
  // CD nodes to server.
  query_hit = 31,  ///< QueryHitRecord of each hit, in order of query, if the frame has queries
  kinds = 17,      ///< KindRecord of each pair of shape kinds that the node tested
  // All roles to server.
  frame_done = 15,  ///< NodeFrameStats: the sender has completed the frame
  // Server to user nodes.
  refused = 16,  ///< RefusedRecord of each refused message or record of the receiver
  // Server to CD nodes, when a node does not respond.
  lost = 19,   ///< LostRecord: a node is lost; if the frame is detected again, a region_map follows
  probe = 20,  ///< no records: reply at once with probe_reply
  // CD nodes to server.
  probe_reply = 21,  ///< no records: the sender still runs
  // User threads to server.
  published = 22,  ///< no records: the publication of the sender's hosted objects can be read
  // Server to user nodes, during the narrow phase.
  read_publications = 23,  ///< no records: all publications of this frame can be read
};
/// One more than the largest message type.
inline constexpr std::uint16_t message_types = 34;

/// The kind of traffic as which a message is counted.
Traffic traffic_of(MessageType type) noexcept;
/// Name of a message type: that of the enumerator; "unknown" for other values.
const char* name_of(MessageType type) noexcept;

/// Value of Header::version; messages with another version are refused.
inline constexpr std::uint16_t protocol_version = 2;

/// The sender or receiver of a message: the server, a CD node or a user node.
struct Endpoint {
  std::uint32_t value = 0;

  static constexpr Endpoint server() noexcept { return {0}; }
  static constexpr Endpoint node(NodeNumber node) noexcept { return {0x40000000u | node}; }
  static constexpr Endpoint user(UserNumber user) noexcept { return {0x80000000u | user}; }
  /// Destination of what the server sends once to all user nodes that share a connection.
  static constexpr Endpoint all_users() noexcept { return {0xbfffffffu}; }
  static constexpr Endpoint none() noexcept { return {0xffffffffu}; }
  constexpr bool is_server() const noexcept { return value == 0; }
  constexpr bool is_node() const noexcept { return (value & 0xc0000000u) == 0x40000000u; }
  constexpr bool is_user() const noexcept { return (value & 0xc0000000u) == 0x80000000u; }
  constexpr std::uint32_t number() const noexcept { return value & 0x3fffffffu; }
  constexpr bool operator==(const Endpoint&) const noexcept = default;
};

/// Precedes the records of every message. Little-endian, 48 bytes; messages are aligned to 8 bytes.
struct Header {
  std::uint16_t version = protocol_version;
  std::uint16_t type = 0;
  std::uint16_t record_bytes = 0;  ///< size of one record with its model state, a multiple of 8
  std::uint16_t last = 0;          ///< 1: last message of the run, and `total` is set; else 0
  std::uint32_t source = 0;        ///< Endpoint::value
  std::uint32_t destination = 0;   ///< Endpoint::value
  std::uint64_t frame = 0;         ///< the frame to which the message belongs, from 0
  std::uint32_t epoch = 0;         ///< of the sender's region map; in region_map, of the new map; 0 from user nodes
  std::uint32_t count = 0;         ///< number of records in this message
  std::uint32_t bytes = 0;         ///< size of the whole message: sizeof(Header) + count * record_bytes
  std::uint32_t reserved = 0;
  std::uint64_t total = 0;  ///< number of records of the whole run if `last` is 1
};
static_assert(sizeof(Header) == 48 && std::is_trivially_copyable_v<Header>);

/// A view of a message whose header decode() has checked. It is valid as long as the bytes of the message. The contents
/// of the records are not checked. Before decode() sets it, a view must not be used.
class MessageView {
 public:
  const Header& header() const noexcept { return header_; }
  MessageType type() const noexcept { return static_cast<MessageType>(header_.type); }
  std::size_t count() const noexcept { return header_.count; }
  bool last() const noexcept { return header_.last != 0; }

  /// A copy of the fixed part of record i, without the model state. Precondition: i < count(), and Record is the struct
  /// that belongs to type().
  template <class Record>
  Record record(std::size_t i) const noexcept {
    Record record;
    std::memcpy(&record, at(i), sizeof(Record));
    return record;
  }
  /// Like record(), but in place; valid as long as the bytes of the message. Reading in place avoids a store-forwarding
  /// stall: a copy is written and read with accesses of different sizes.
  template <class Record>
  const Record& view(std::size_t i) const noexcept {
    static_assert(alignof(Record) <= 8 && std::is_trivially_copyable_v<Record>);
    return *std::launder(reinterpret_cast<const Record*>(at(i)));
  }
  /// The first byte of record i.
  const std::byte* at(std::size_t i) const noexcept { return records_ + i * header_.record_bytes; }
  /// The model state after the fixed part of record i.
  template <class Record>
  const std::byte* state(std::size_t i) const noexcept {
    return at(i) + sizeof(Record);
  }

 private:
  friend Status decode(std::span<const std::byte> bytes, std::size_t state_bytes, MessageView& out) noexcept;
  Header header_;
  const std::byte* records_ = nullptr;
};

/// Checks the header of a received message, whose sender need not be trusted: version and type must be known; record
/// size, count and length must fit the type and each other. Source, destination, frame and epoch are not checked.
/// `state_bytes` is the size of this world's model state, rounded up to a multiple of 8.
///
/// Returns ok and sets `out`, which is valid as long as `bytes`; or returns bad_message and leaves `out` unchanged.
Status decode(std::span<const std::byte> bytes, std::size_t state_bytes, MessageView& out) noexcept;

/// Size in bytes of one record of that type, including a model state of `state_bytes` bytes (a multiple of 8) if
/// records of this type have one; 0 for types without records.
std::size_t record_bytes(MessageType type, std::size_t state_bytes) noexcept;

}  // namespace ringfence::messages
