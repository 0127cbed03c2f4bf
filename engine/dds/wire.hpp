#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include <dds/dds.h>

#include "messages/header.hpp"
#include "messages/records.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/frame_report.hpp"
#include "ringfence/motion_model.hpp"
#include "wire.h"

namespace ringfence::dds {

using PresenceSample = ringfence_wire_Presence;
using TermsSample = ringfence_wire_Terms;
using PieceSample = ringfence_wire_Piece;
using ListenerSample = ringfence_wire_Listener;

/// State of a node in its Presence.
enum class NodeState : std::uint32_t {
  joining,  ///< receives parameters, shapes and regions
  ready,    ///< may be assigned
  leaving,  ///< is assigned and wants to leave
  refused,  ///< incompatible; see Presence::reason
};

/// What the process that opens a link writes first.
struct LinkHello {
  static constexpr std::uint64_t expected_magic = 0x52464c494e4b3032;  ///< "RFLINK02"
  std::uint64_t magic = expected_magic;
  std::uint64_t sender = 0;    ///< incarnation of the node, or number of the World
  std::uint64_t receiver = 0;  ///< incarnation
};
static_assert(sizeof(LinkHello) == 24);

/// Kind of a parcel.
enum class ParcelKind : std::uint32_t {
  messages,          ///< whole messages; see Packing
  assign,            ///< World to node, before a frame: AssignmentRecord, then a PeerRecord for each slot
  dismissed,         ///< World to node: the node is no longer assigned; it announces itself again or ends
  assignment_query,  ///< node to World: asks whether it is still assigned
  assignment_reply,  ///< World to node: it is. If it is not, the World has closed the link
  peer_failed,       ///< node to World: PeerFailureRecord
  model_failed,      ///< node to World, at the end of a frame: ModelFailureRecord
};

/// Header of a parcel on the link between the World and a node: 16 bytes; its contents follow.
struct ParcelHeader {
  std::uint32_t bytes;   ///< of the contents, a multiple of 8
  std::uint32_t kind;    ///< ParcelKind
  std::uint32_t shapes;  ///< number of shapes of the World, which the receiver needs to read the contents
  std::uint32_t reserved;
};
static_assert(sizeof(ParcelHeader) == 16);

/// Header of each message in a parcel, or on the link between two nodes: 8 bytes. The message follows, padded to a
/// multiple of 8. Its own header (messages::Header) names source and destination.
struct Packing {
  std::uint32_t bytes;  ///< of the message
  std::uint32_t reserved;
};
static_assert(sizeof(Packing) == 8);

/// Where a node listens for links of the World and of other nodes: an IPv4 address and a TCP port, both in the
/// machine's byte order.
struct LinkAddress {
  std::uint32_t host = 0;  ///< 0: unknown
  std::uint32_t port = 0;  ///< 0: unknown
  constexpr bool is_known() const noexcept { return host != 0 && port != 0; }
};

/// Kind of a Piece.
enum class PieceKind : std::uint32_t {
  shape,    ///< `number` is the ShapeNumber; removed with `epoch` removed_shape_epoch
  regions,  ///< the region map's table, with its `epoch`
  setup,    ///< ClusterConfig::setup
};

/// Assignment of a node from the next frame on.
struct AssignmentRecord {
  std::uint32_t number = 0;     ///< the node's slot, below `count`
  std::uint32_t count = 0;      ///< all slots in use are below this number
  std::uint64_t objects = 0;    ///< number of objects to reserve for
  std::uint64_t pairs = 0;      ///< number of pairs to reserve for
  std::uint32_t epoch = 0;      ///< of the current map
  std::uint32_t map_nodes = 0;  ///< all owners in that map are below this number
  std::uint32_t map_words = 0;  ///< size of its table
  std::uint32_t reserved = 0;
};
static_assert(sizeof(AssignmentRecord) == 40 && std::is_trivially_copyable_v<AssignmentRecord>);

/// The node in one slot, as the others reach it. All fields are 0 for a free slot, the receiver's own slot, and a node
/// in the process of the World.
struct PeerRecord {
  std::uint64_t incarnation = 0;
  LinkAddress address;
};
static_assert(sizeof(PeerRecord) == 16 && std::is_trivially_copyable_v<PeerRecord>);

/// The sender cannot exchange messages with another node: the link is closed, the node does not respond, or it breaks
/// the protocol.
struct PeerFailureRecord {
  std::uint64_t incarnation = 0;  ///< of the other node
};

/// The motion model threw for an object; see ModelFailure.
struct ModelFailureRecord {
  std::uint64_t object = 0;  ///< ObjectId::value
  char text[max_model_failure_text] = {};
};
static_assert(sizeof(ModelFailureRecord) == 8 + max_model_failure_text);

/// Epoch of the empty Piece that replaces a removed shape.
inline constexpr std::uint32_t removed_shape_epoch = 1;

/// Version of this protocol between processes. Messages have a version of their own.
inline constexpr std::uint32_t wire_version = 2;

/// Hash of the version of the messages and of the record sizes. It differs if a record has another size; a change of
/// the layout that keeps all sizes needs another version. See fingerprint().
constexpr std::uint64_t record_layout_hash() noexcept {
  using namespace messages;
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const std::size_t size : {std::size_t{protocol_version},
                                 sizeof(Header),
                                 sizeof(ObjectRef),
                                 sizeof(StateRecord),
                                 sizeof(NodeStateRecord),
                                 sizeof(ReplicaRecord),
                                 sizeof(PositionRecord),
                                 sizeof(PairRecord),
                                 sizeof(CollisionRecord),
                                 sizeof(CorrectRecord),
                                 sizeof(ChangeRecord),
                                 sizeof(NarrowDoneRecord),
                                 sizeof(HandOverRecord),
                                 sizeof(DropRecord),
                                 sizeof(PlaceRecord),
                                 sizeof(OwnerRecord),
                                 sizeof(FrameEndRecord),
                                 sizeof(NodeFrameStats),
                                 sizeof(KindRecord),
                                 sizeof(LostRecord),
                                 sizeof(RefusedRecord),
                                 sizeof(QueryRecord),
                                 sizeof(QueryHitRecord),
                                 sizeof(SensedRecord),
                                 sizeof(Contact),
                                 sizeof(AssignmentRecord),
                                 sizeof(PeerRecord),
                                 sizeof(PeerFailureRecord),
                                 sizeof(ModelFailureRecord),
                                 sizeof(ParcelHeader),
                                 max_motion_state}) {
    hash = (hash ^ size) * 0x100000001b3u;
  }
  return hash;
}

/// Writes a constant in this machine's byte order, so that processes can compare their byte orders.
inline void write_byte_order(std::uint8_t (&order)[4]) noexcept {
  constexpr std::uint32_t mark = 0x01020304;
  std::memcpy(order, &mark, sizeof mark);
}

/// A byte sequence that refers to `bytes` without copying them: for writing only, while `bytes` exist.
inline ringfence_wire_Bytes borrow(std::span<const std::byte> bytes) noexcept {
  ringfence_wire_Bytes borrowed{};
  borrowed._maximum = borrowed._length = static_cast<std::uint32_t>(bytes.size());
  borrowed._buffer = reinterpret_cast<std::uint8_t*>(const_cast<std::byte*>(bytes.data()));
  borrowed._release = false;
  return borrowed;
}
/// The bytes of a sequence. Valid as long as the sequence.
inline std::span<const std::byte> bytes_of(const ringfence_wire_Bytes& bytes) noexcept {
  return {reinterpret_cast<const std::byte*>(bytes._buffer), bytes._length};
}

}  // namespace ringfence::dds
