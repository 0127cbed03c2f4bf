#pragma once

#include <cstdint>
#include <type_traits>

#include "geometry/bounds.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/frame_report.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::messages {

/// An object in messages: the server's slot for it, so that nobody has to look it up, and the number and generation
/// against which the slot is checked.
struct ObjectRef {
  std::uint32_t slot = 0;
  std::uint32_t generation = 0;
  ObjectNumber number = 0;
  std::uint32_t flags = 0;  ///< ObjectFlag bits
};

enum ObjectFlag : std::uint32_t {
  flag_present = 1,      ///< the object takes part in contacts
  flag_left_region = 2,  ///< position_update: the object is no longer in the receiver's region
  flag_interior = 4,     ///< node_state: present, and all cells that the bounds touch are the sender's
  flag_keeps_host = 8,   ///< node_state: by its position and the map as it is, the sender hosts it in the next frame
                        ///< too; the same where its host tells it to other nodes in memory that they share
  flag_host_owned = 16,  ///< node_state, hand_over: from now on its host keeps its states from the server, which finds
                         ///< them in memory that they share, and tells the nodes whose regions it touches
  flag_at_rest = 32,  ///< node_state: as in the frame before; told because the sender keeps it to itself no more
  flag_avatar = 64,   ///< position_update: a user node hosts the object
  flag_fixed = 128,   ///< position_update: nobody hosts it; else whoever the deployment says, in user/collision
                      ///< deployment from the next frame on the CD node that owns the cell of its position
};

/// M1. Followed by the model's state.
struct StateRecord {
  ObjectRef object;
  Pose pose;
};

/// A CD node's word on an object that it hosts. Followed by the model's state.
struct NodeStateRecord {
  ObjectRef object;
  Pose pose;
  geometry::Bounds bounds;
};

/// M2: all that a CD node needs to know of an object to test it.
struct PositionRecord {
  ObjectRef object;
  Pose pose;
  geometry::Bounds bounds;
  ShapeNumber shape = 0;
  std::uint32_t layer = 0;
};

/// M2: a candidate pair, by slots; `a` has the lower number.
struct PairRecord {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
};

/// M3. Numbers and poses are those that the two slots have in this frame: server and node hold the same, frozen.
struct CollisionRecord {
  std::uint32_t slot_a = 0;
  std::uint32_t slot_b = 0;
  float depth = 0;
  Vec3f normal;
  Vec3d point;
};

/// M4 for contacts that the receiver found itself: bit i says that the i-th of 64 persists, else it begins.
struct ConfirmRecord {
  std::uint64_t persists = 0;
};

/// Ends a node's narrow phase.
struct NarrowDoneRecord {
  std::uint64_t candidates = 0;  ///< pairs that the node owns
  std::uint64_t tested = 0;
  std::uint64_t contacts = 0;
};

/// M5, and the server's order to host an object. Followed by the model's state: the whole of S(k).
struct HandOverRecord {
  ObjectRef object;
  Pose pose;
  std::uint64_t user_data = 0;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;
  std::uint16_t category = 0;
};

struct DropRecord {
  ObjectRef object;
};

struct PlaceRecord {
  ObjectRef object;
  Pose pose;
};

struct OwnerRecord {
  std::uint32_t owner = 0;
  std::uint32_t reserved = 0;
};

struct FrameEndRecord {
  std::uint64_t hand_overs = 0;  ///< that will reach the receiver in this frame
};

/// What a role did in the frame that it declares complete. Times in nanoseconds.
struct NodeFrameStats {
  std::uint64_t busy_ns = 0, cpu_ns = 0, move_ns = 0, broad_phase_ns = 0, narrow_phase_ns = 0;
  std::uint64_t hosted = 0, handed_over = 0;
  std::uint64_t model_failed = 0, not_finite = 0, not_unit = 0;  ///< model outputs refused, by reason
  std::uint64_t m5_messages = 0, m5_bytes = 0;
  std::uint64_t published = 0;       ///< states in the role's publication
  std::uint64_t move_cpu_ns = 0;     ///< of cpu_ns: until all states are told
  std::uint64_t detect_cpu_ns = 0;   ///< of cpu_ns: from then until all contacts are, without publish_cpu_ns
  std::uint64_t kept = 0;            ///< states that changed and that the sender kept to itself
  std::uint64_t publish_cpu_ns = 0;  ///< of cpu_ns: from when all states are told until they are published
};

/// A node's narrow phase by two kinds of shapes; see KindReport.
struct KindRecord {
  std::uint32_t first = 0;  ///< ShapeKind
  std::uint32_t second = 0;
  std::uint64_t candidates = 0, hits = 0, lanes = 0, lanes_filled = 0, iterations = 0, ended_early = 0;
  std::uint64_t timed = 0, nanoseconds = 0, gather_nanoseconds = 0;
  std::uint32_t cost[cost_buckets] = {};
};

/// A node has stopped answering.
struct LostRecord {
  std::uint32_t node = 0;
  std::uint32_t again = 0;       ///< 1: forget what was tested in this frame, it is detected anew under another map
  std::uint64_t hand_overs = 0;  ///< of those announced by frame_end, so many will not come: they were the node's
};

struct RefusedRecord {
  ObjectNumber number = 0;
  std::uint32_t reason = 0;  ///< Status
};

static_assert(sizeof(ObjectRef) == 16);
static_assert(sizeof(StateRecord) == 56);
static_assert(sizeof(NodeStateRecord) == 80);
static_assert(sizeof(PositionRecord) == 88);
static_assert(sizeof(PairRecord) == 8);
static_assert(sizeof(CollisionRecord) == 48 && sizeof(ConfirmRecord) == 8);
static_assert(sizeof(NarrowDoneRecord) == 24);
static_assert(sizeof(HandOverRecord) == 72);
static_assert(sizeof(DropRecord) == 16);
static_assert(sizeof(PlaceRecord) == 56);
static_assert(sizeof(OwnerRecord) == 8 && sizeof(FrameEndRecord) == 8 && sizeof(RefusedRecord) == 8);
static_assert(sizeof(KindRecord) == 240);
static_assert(sizeof(NodeFrameStats) == 136);
static_assert(sizeof(LostRecord) == 16);
static_assert(std::is_trivially_copyable_v<CollisionRecord> && std::is_trivially_copyable_v<HandOverRecord>);

}  // namespace ringfence::messages
