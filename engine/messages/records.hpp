#pragma once

#include <cstdint>
#include <type_traits>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/profile.hpp"

namespace ringfence::messages {

/// An object in a message. With the slot the receiver needs no search; number and generation show whether the slot
/// still holds this object.
struct ObjectRef {
  std::uint32_t slot = 0;  ///< index in the server's object table
  std::uint32_t generation = 0;
  ObjectNumber number = 0;
  std::uint32_t flags = 0;  ///< bits of ObjectFlag
};

/// Flags of an object in a message. If the comment of a flag names messages, the flag is used only in these.
enum ObjectFlag : std::uint32_t {
  flag_present = 1,      ///< the object takes part in contacts
  flag_left_region = 2,  ///< position_update: the object is no longer in the receiver's region
  flag_interior = 4,     ///< node_state: present, and the sender owns all cells that the bounds touch
  /// node_state, and ghost updates in shared memory: the sender also hosts the object in the next frame, by the
  /// position of the object and the current map.
  flag_keeps_host = 8,
  /// node_state, hand_over: from now on the state of the object is host-owned. The server reads it in shared memory
  /// when needed, or receives it as `replica`. The host sends ghost updates to the other nodes whose regions the object
  /// touches.
  flag_host_owned = 16,
  flag_at_rest = 32,  ///< node_state: the state is unchanged; it is sent because it is no longer host-owned
  flag_avatar = 64,   ///< position_update: a user node hosts the object
  /// position_update: no role hosts the object, because it is static. An object without flag_avatar and flag_fixed has
  /// the host that the deployment determines: in user/collision deployment, from the next frame on, the CD node that
  /// owns the cell of its position.
  flag_fixed = 128,
  /// M1, node_state: the object was placed at the pose, by World::place or by its model; it did not move there. Such an
  /// object is not host-owned in that frame.
  flag_jumped = 256,
  flag_placed = 512,  ///< in no message: a host has placed the object for the server, and has not moved it since
  /// In no message: the host has adopted the object from the server, and has not moved it since.
  flag_adopted = 1024,
  /// In no message: the object had flag_adopted before this frame's move, so the server sends it to the nodes too.
  flag_renewed = 2048,
};

/// M1: the state of an object that the sending user node hosts. The model state follows.
struct StateRecord {
  ObjectRef object;
  Pose pose;
};

/// The state of an object that the sending CD node hosts. The model state follows.
struct NodeStateRecord {
  ObjectRef object;
  Pose pose;
  geometry::Bounds bounds;
};

/// The pose of a present object that the sending CD node hosts, with the host-owned state of this frame and of the
/// frame before. The server keeps it for recovery and for user nodes. The model state follows.
struct ReplicaRecord {
  std::uint32_t slot = 0;
  std::uint32_t generation = 0;
  Pose pose;
};

/// M2: everything that a CD node needs to test an object. The pose and the bounds are those of this frame.
struct PositionRecord {
  ObjectRef object;
  Pose pose;
  geometry::Bounds bounds;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;     ///< 0 to 31
  std::uint16_t category = 0;  ///< value of Category; what moves the object is in the flags
  std::uint32_t group = 0;
  std::uint32_t crowd = 0;  ///< 0, or see broad_phase/crowds.hpp
  std::uint64_t user_data = 0;
};

/// M2: a candidate pair, by the slots of its objects. `a` has the lower object number.
struct PairRecord {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
};

/// M3: a contact. The objects are those that the two slots have in this frame; the server adds what does not change
/// from frame to frame. The other fields are as in Contact.
struct CollisionRecord {
  std::uint32_t slot_a = 0;  ///< of the object with the lower number
  std::uint32_t slot_b = 0;
  std::uint32_t reserved = 0;
  float depth = 0;
  Vec3f normal;
  Vec3f point;  ///< relative to the position of a in this frame, world axes, metres
};

/// M3: a contact that the sender found in this frame and not in the frame before, or the other way round.
struct ChangeRecord {
  std::uint64_t key = 0;       ///< number of a in the upper 32 bits, number of b in the lower
  std::uint32_t position = 0;  ///< where the contact began: its position in the sender's run of `collision`; else 0
  std::uint32_t flags = 0;     ///< bits of ChangeFlag
};

enum ChangeFlag : std::uint32_t {
  change_ended = 1,      ///< not found any more; without this flag the contact was not found in the frame before
  change_at_border = 2,  ///< another node may have found the contact in the other of the two frames
};

/// M4: a contact that the receiver found and that is not among the deepest of either of its objects; see
/// WorldConfig::deepest_contacts. The receiver treats it as not found.
struct UnlistRecord {
  std::uint64_t key = 0;  ///< number of a in the upper 32 bits, number of b in the lower
};

/// M4: a contact that the receiver reported as begun. Another node found it in the frame before, so it persists.
struct CorrectRecord {
  std::uint32_t position = 0;  ///< in the receiver's run of `collision`, without those that `unlist` names
  std::uint32_t reserved = 0;
};

/// Ends the narrow phase of a node in a frame.
struct NarrowDoneRecord {
  std::uint64_t candidates = 0;       ///< pairs that the node owns
  std::uint64_t tested = 0;           ///< pairs that the node tested
  std::uint64_t carried = 0;          ///< pairs of two objects that rest, whose result is that of the frame before
  std::uint64_t contacts = 0;         ///< contacts that the node sends, or shares in memory, in this frame
  std::uint64_t failed_supports = 0;  ///< tested pairs without a result because a support function failed
};

/// M5 (hand_over), and adopt: the receiver becomes the host of this object. The model state follows; together they are
/// all of S(k).
struct HandOverRecord {
  ObjectRef object;
  Pose pose;
  std::uint64_t user_data = 0;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;     ///< 0 to 31
  std::uint16_t category = 0;  ///< value of Category
  std::uint32_t group = 0;
  std::uint32_t reserved = 0;
};

/// The receiver no longer hosts this object.
struct DropRecord {
  ObjectRef object;
};

/// The object has this pose now, and is absent if flag_present is not set.
struct PlaceRecord {
  ObjectRef object;
  Pose pose;
};

/// One entry of the table of a region map; see regions::RegionMap.
struct OwnerRecord {
  std::uint32_t owner = 0;  ///< a word of RegionMap::table()
  std::uint32_t reserved = 0;
};

/// The number of records that the sender sends to another CD node in this frame.
struct CountRecord {
  std::uint32_t node = 0;   ///< the receiver
  std::uint32_t count = 0;  ///< not 0
};

/// All hosts have moved.
struct GhostsSentRecord {
  std::uint64_t ghosts =
      0;  ///< number of `ghost` records that the receiver gets in this frame, from all nodes together
};

/// The phases of all contacts of the frame are final.
struct FrameEndRecord {
  std::uint64_t hand_overs = 0;  ///< number of hand-overs that the receiver gets in this frame, from all nodes together
  std::uint64_t contacts = 0;    ///< the same for contacts (`notify`)
  /// 1: with the new map that this frame has sent, nodes send each other all objects that they host.
  std::uint32_t hosts_exchange_objects = 0;
  std::uint32_t reserved = 0;
};

/// Statistics of a role for the frame that it has completed. Times in nanoseconds. User nodes leave most fields 0; see
/// docs/protocol.md.
struct NodeFrameStats {
  /// Wall time in which the role made progress; CPU time of its thread, of a node that reads the server's words without
  /// what it spends while it waits for them; wall times of moving and of the two phases.
  std::uint64_t busy_ns = 0, cpu_ns = 0, move_ns = 0, broad_phase_ns = 0, narrow_phase_ns = 0;
  std::uint64_t hosted = 0, handed_over = 0;  ///< objects hosted after the frame; objects handed over to others
  std::uint64_t model_failed = 0, not_finite = 0, not_unit = 0;  ///< refused model outputs, by reason
  std::uint64_t m5_messages = 0, m5_bytes = 0;                   ///< hand_over messages sent, and their bytes
  std::uint64_t published = 0;                                   ///< states in the role's publication
  std::uint64_t move_cpu_ns = 0;  ///< part of cpu_ns: from the start of the frame until all states are sent
  /// Part of cpu_ns: from the time when all states are sent until all contacts are sent, without publish_cpu_ns.
  std::uint64_t detect_cpu_ns = 0;
  std::uint64_t host_owned_changes = 0;  ///< host-owned states that changed and were not sent
  /// Part of cpu_ns: from the time when all states are sent until they are published.
  std::uint64_t publish_cpu_ns = 0;
  /// Answers to queries: wall time; tested boxes, exact tests, and how many of these a support function ended.
  std::uint64_t query_ns = 0, query_boxes = 0, query_tests = 0, query_failed_supports = 0;
};

/// Narrow phase statistics of a node for one pair of shape kinds; KindReport has the same fields.
struct KindRecord {
  std::uint32_t first = 0;   ///< value of ShapeKind
  std::uint32_t second = 0;  ///< value of ShapeKind, not less than `first`
  std::uint64_t candidates = 0, hits = 0, lanes = 0, lanes_filled = 0, iterations = 0, ended_early = 0;
  std::uint64_t timed = 0, nanoseconds = 0, gather_nanoseconds = 0;
  std::uint32_t cost[cost_buckets] = {};
};

/// A node is lost.
struct LostRecord {
  std::uint32_t node = 0;          ///< number of the lost node in this frame
  std::uint32_t detect_again = 0;  ///< 1: discard the results of this frame, which is detected again under another map
  /// Number of hand-overs that frame_end has announced and that do not count any more, because the lost node is their
  /// sender.
  std::uint64_t hand_overs = 0;
  std::uint64_t contacts = 0;  ///< the same for contacts (`notify`)
};

/// Kinds of queries; see ringfence/query.hpp.
enum class QueryKind : std::uint32_t { cast, cast_any, cast_all, sweep, sweep_all, overlap, nearest };
inline constexpr std::uint32_t query_kinds = 7;

/// A query that all CD nodes answer for the objects that they own. Every node receives the same queries in the same
/// order, so that a position in this order names a query.
struct QueryRecord {
  std::uint32_t kind = 0;                    ///< value of QueryKind
  ShapeNumber shape = 0;                     ///< sweep, sweep_all, overlap: the shape, not a mesh; else 0
  Pose start;                                ///< the start, or the point; of a shape also its orientation
  Vec3d displacement;                        ///< 0 for overlap and nearest
  double distance = 0;                       ///< nearest: the largest distance, metres, >= 0, may be infinite; else 0
  std::uint32_t layers = 0, categories = 0;  ///< of QueryFilter, as the next three
  std::uint32_t except_group = 0;
  ObjectNumber except_number = 0;  ///< 0: none
  std::uint32_t except_generation = 0;
  std::uint32_t reserved = 0;
};

/// Whether a shape moves or overlaps in a query of that kind. Precondition: the kind is one of QueryKind.
constexpr bool has_shape(const QueryRecord& record) noexcept {
  const auto kind = static_cast<QueryKind>(record.kind);
  return kind == QueryKind::sweep || kind == QueryKind::sweep_all || kind == QueryKind::overlap;
}

/// Whether the answer of a node to a query of that kind may have several hits.
constexpr bool has_list(const QueryRecord& record) noexcept {
  const auto kind = static_cast<QueryKind>(record.kind);
  return kind == QueryKind::cast_all || kind == QueryKind::sweep_all || kind == QueryKind::overlap;
}

/// What a CD node found for one query at one object that it owns: one record for each object that a query with a list
/// finds; for the other queries only the first or nearest of the node's objects.
struct QueryHitRecord {
  std::uint32_t query = 0;  ///< position in the run of queries
  std::uint32_t slot = 0;   ///< of the object
  std::uint32_t child = 0;  ///< this and the rest as in Hit; 0 for cast_any
  std::uint32_t triangle = 0;
  double place = 0;  ///< the fraction; nearest: the distance
  Vec3d point;
  Vec3d normal;
};

/// A present object of the frame before, as queries of motion models find it.
struct SensedRecord {
  Pose pose;
  std::uint64_t user_data = 0;
  ObjectNumber number = 0;
  std::uint32_t generation = 0;
  ShapeNumber shape = 0;
  std::uint32_t group = 0;
  std::uint16_t layer = 0;     ///< 0 to 31
  std::uint16_t category = 0;  ///< value of Category
  std::uint32_t reserved = 0;
};

/// A message or record of the receiver that the server refused. `number` is 0 for a whole message.
struct RefusedRecord {
  ObjectNumber number = 0;
  std::uint32_t reason = 0;  ///< value of Status
};

static_assert(sizeof(ObjectRef) == 16);
static_assert(sizeof(StateRecord) == 56);
static_assert(sizeof(NodeStateRecord) == 80 && sizeof(ReplicaRecord) == 48);
static_assert(sizeof(PositionRecord) == 104);
static_assert(sizeof(PairRecord) == 8);
static_assert(sizeof(CollisionRecord) == 40 && sizeof(ChangeRecord) == 16 && sizeof(CorrectRecord) == 8);
static_assert(sizeof(UnlistRecord) == 8);
static_assert(sizeof(NarrowDoneRecord) == 40);
static_assert(sizeof(HandOverRecord) == 80);
static_assert(sizeof(DropRecord) == 16);
static_assert(sizeof(PlaceRecord) == 56);
static_assert(sizeof(OwnerRecord) == 8 && sizeof(FrameEndRecord) == 24 && sizeof(RefusedRecord) == 8);
static_assert(sizeof(CountRecord) == 8 && sizeof(GhostsSentRecord) == 8);
static_assert(sizeof(KindRecord) == 240);
static_assert(sizeof(NodeFrameStats) == 168);
static_assert(sizeof(QueryRecord) == 104 && sizeof(QueryHitRecord) == 72 && sizeof(SensedRecord) == 72);
static_assert(sizeof(LostRecord) == 24);
static_assert(std::is_trivially_copyable_v<CollisionRecord> && std::is_trivially_copyable_v<HandOverRecord>);

}  // namespace ringfence::messages
