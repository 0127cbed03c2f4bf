#pragma once

#include <cstdint>
#include <type_traits>

#include "geometry/bounds.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/frame_report.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::messages {

/// An object in a message: the server's slot for it, which saves a look-up, and the number and generation that the
/// receiver compares with that slot.
struct ObjectRef {
  std::uint32_t slot = 0;
  std::uint32_t generation = 0;
  ObjectNumber number = 0;
  std::uint32_t flags = 0;  ///< bits of ObjectFlag
};

enum ObjectFlag : std::uint32_t {
  flag_present = 1,      ///< the object takes part in contacts
  flag_left_region = 2,  ///< position_update: the object is no longer in the receiver's region
  flag_interior = 4,     ///< node_state: present, and the sender owns all cells that the bounds touch
  /// node_state, and ghost updates in shared memory: by its position and the current map, the sender hosts the object
  /// in the next frame too.
  flag_keeps_host = 8,
  /// node_state, hand_over: from now on the object is host-owned. Its host does not send its states to the server,
  /// which reads them in shared memory when needed; the host sends ghost updates to the nodes whose regions it touches.
  flag_host_owned = 16,
  flag_at_rest = 32,  ///< node_state: unchanged; sent because the object is no longer host-owned
  flag_avatar = 64,   ///< position_update: a user node hosts the object
  /// position_update: no node hosts the object. Without this flag, the deployment determines the host: in
  /// user/collision deployment, from the next frame on, the CD node that owns the cell of its position.
  flag_fixed = 128,
};

/// M1. The model state follows.
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

/// M2: everything that a CD node needs to test an object.
struct PositionRecord {
  ObjectRef object;
  Pose pose;
  geometry::Bounds bounds;
  ShapeNumber shape = 0;
  std::uint32_t layer = 0;
};

/// M2: a candidate pair, by slots. `a` has the lower object number.
struct PairRecord {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
};

/// M3. The objects and poses are those of the two slots in this frame; they do not change between M2 and M3.
struct CollisionRecord {
  std::uint32_t slot_a = 0;
  std::uint32_t slot_b = 0;
  float depth = 0;
  Vec3f normal;
  Vec3d point;
};

/// M4 for 64 contacts that the receiver itself produced: if bit i is set, contact i persists, else it begins.
struct ConfirmRecord {
  std::uint64_t persists = 0;
};

/// Ends the narrow phase of a node.
struct NarrowDoneRecord {
  std::uint64_t candidates = 0;  ///< pairs that the node owns
  std::uint64_t tested = 0;
  std::uint64_t contacts = 0;
  std::uint64_t failed_supports = 0;  ///< of those tested: without an answer, since a support function failed
};

/// M5, and the server's `adopt`. The model state follows; together they are all of S(k).
struct HandOverRecord {
  ObjectRef object;
  Pose pose;
  std::uint64_t user_data = 0;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;
  std::uint16_t category = 0;
};

/// The receiver does not host this object any more.
struct DropRecord {
  ObjectRef object;
};

/// The object is at this pose now; it is absent if flag_present is not set.
struct PlaceRecord {
  ObjectRef object;
  Pose pose;
};

/// One entry of the region map's table.
struct OwnerRecord {
  std::uint32_t owner = 0;
  std::uint32_t reserved = 0;
};

/// All contacts of the frame are sent.
struct FrameEndRecord {
  std::uint64_t hand_overs = 0;  ///< number of hand-overs that the receiver gets in this frame
};

/// Statistics of a role for the frame that it has completed. Times in nanoseconds.
struct NodeFrameStats {
  std::uint64_t busy_ns = 0, cpu_ns = 0, move_ns = 0, broad_phase_ns = 0, narrow_phase_ns = 0;
  std::uint64_t hosted = 0, handed_over = 0;
  std::uint64_t model_failed = 0, not_finite = 0, not_unit = 0;  ///< refused model outputs, by reason
  std::uint64_t m5_messages = 0, m5_bytes = 0;
  std::uint64_t published = 0;      ///< states in the role's publication
  std::uint64_t move_cpu_ns = 0;    ///< part of cpu_ns: until all states are sent
  std::uint64_t detect_cpu_ns = 0;  ///< part of cpu_ns: from then until all contacts are sent, without publish_cpu_ns
  std::uint64_t host_owned_changes = 0;  ///< host-owned states that changed and were not sent
  std::uint64_t publish_cpu_ns = 0;      ///< part of cpu_ns: between sending the states and publishing them
};

/// Narrow phase statistics of a node for one pair of shape kinds; see KindReport.
struct KindRecord {
  std::uint32_t first = 0;  ///< ShapeKind
  std::uint32_t second = 0;
  std::uint64_t candidates = 0, hits = 0, lanes = 0, lanes_filled = 0, iterations = 0, ended_early = 0;
  std::uint64_t timed = 0, nanoseconds = 0, gather_nanoseconds = 0;
  std::uint32_t cost[cost_buckets] = {};
};

/// A node is lost.
struct LostRecord {
  std::uint32_t node = 0;
  std::uint32_t detect_again = 0;  ///< 1: discard the results of this frame; it is detected again under another map
  /// Number of hand-overs that frame_end announced and that will not arrive: the lost node was their sender.
  std::uint64_t hand_overs = 0;
};

/// A message or record of the receiver that the server refused. `number` is 0 for a whole message.
struct RefusedRecord {
  ObjectNumber number = 0;
  std::uint32_t reason = 0;  ///< value of Status
};

static_assert(sizeof(ObjectRef) == 16);
static_assert(sizeof(StateRecord) == 56);
static_assert(sizeof(NodeStateRecord) == 80);
static_assert(sizeof(PositionRecord) == 88);
static_assert(sizeof(PairRecord) == 8);
static_assert(sizeof(CollisionRecord) == 48 && sizeof(ConfirmRecord) == 8);
static_assert(sizeof(NarrowDoneRecord) == 32);
static_assert(sizeof(HandOverRecord) == 72);
static_assert(sizeof(DropRecord) == 16);
static_assert(sizeof(PlaceRecord) == 56);
static_assert(sizeof(OwnerRecord) == 8 && sizeof(FrameEndRecord) == 8 && sizeof(RefusedRecord) == 8);
static_assert(sizeof(KindRecord) == 240);
static_assert(sizeof(NodeFrameStats) == 136);
static_assert(sizeof(LostRecord) == 16);
static_assert(std::is_trivially_copyable_v<CollisionRecord> && std::is_trivially_copyable_v<HandOverRecord>);

}  // namespace ringfence::messages
