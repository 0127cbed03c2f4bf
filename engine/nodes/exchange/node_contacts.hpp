#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "geometry/vector.hpp"
#include "link/doorbell.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "nodes/exchange/frame_control.hpp"
#include "nodes/exchange/ghost_updates.hpp"
#include "nodes/exchange/hand_over_list.hpp"
#include "nodes/exchange/host_owned_states.hpp"
#include "nodes/exchange/node_queries.hpp"
#include "nodes/exchange/object_row.hpp"
#include "nodes/exchange/peer_lists.hpp"
#include "nodes/exchange/read_gate.hpp"
#include "nodes/exchange/sender_set.hpp"
#include "queries/recorded_frame.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::nodes {

class Host;
class RegionObjects;
struct OutputMerge;

/// Slots of a contact's two objects, and the node that found it.
struct Found {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  NodeNumber by = 0;
};

/// A contact in the list of the node that found it.
struct FoundContact {
  std::uint32_t slot_a = 0;
  std::uint32_t slot_b = 0;
  std::uint32_t body_a = 0;  ///< index into NodeContacts::bodies; unused if NodeContacts::bodies is null
  std::uint32_t body_b = 0;
  std::uint32_t touch = 0;  ///< index into NodeContacts::touches
};

/// A contact that concerns a user node, with all that the server needs to notify it.
struct UserContact {
  std::uint64_t key = 0;
  std::uint32_t position = 0;  ///< in NodeContacts::keys
  FoundContact found;
};

/// A contact whose phase the node cannot decide alone.
struct BorderContact {
  std::uint64_t key = 0;
  std::uint32_t position = 0;  ///< in NodeContacts::keys
};

/// What the server reads of the contacts of each CD node, in one cache line. The spans refer to the lists of the same
/// names in NodeContacts, or to BorderCopies.
struct ContactSummary {
  std::uint32_t contacts = 0;  ///< number of keys
  std::uint32_t began = 0;     ///< number of those that are not in keys_before
  std::span<const BorderContact> border_beginning;
  std::span<const std::uint64_t> ending, border_ending;
  std::uint8_t* begun = nullptr;
};
static_assert(sizeof(ContactSummary) <= 64);

/// Copies of short lists of contacts at borders. The server reads those of all nodes: of a thousand, each list in
/// memory of its own would cost it a TLB miss.
struct BorderCopies {
  static constexpr std::size_t most = 8;
  BorderContact beginning[most];
  std::uint64_t ending[most];

  std::span<const BorderContact> copy(std::span<const BorderContact> list) noexcept { return copy(list, beginning); }
  std::span<const std::uint64_t> copy(std::span<const std::uint64_t> list) noexcept { return copy(list, ending); }

 private:
  template <class T>
  static std::span<const T> copy(std::span<const T> list, T* copies) noexcept {
    if (list.size() > most) {
      return list;
    }
    std::copy(list.begin(), list.end(), copies);
    return {copies, list.size()};
  }
};

/// Contacts of one CD node in one frame, in memory shared by all roles of a process. They replace the messages
/// `collision`, `change`, `correct` and, between nodes, `notify`.
///
/// A node lists its contacts by (a, b) and compares them with those of the frame before. A pair that is in one list
/// only has begun or ended, or has moved from or to another node. It cannot have moved if one of its two objects
/// touched no other region while the other list was made. The server compares only the remaining pairs of all nodes and
/// corrects their phases. Then each node writes a slice of the embedder's lists, from the contacts of all nodes, and
/// reads from the other nodes' contacts those that concern the objects that it hosts. So the server's work is
/// proportional to the contacts that change at borders and to those of avatars.
///
/// A contact has 120 bytes, half of them values of two bodies that the node holds anyway. So it is assembled only
/// where it is read: by the node's own motion model, or in the embedder's list.
///
/// Threads: one writer at a time, ordered by the words of FrameControl. The node writes its part before it reports
/// `tested` and does not change it until the next `frame_begin`. The server reads it after `tested`, unlists contacts
/// of it and writes its own part before `frame_end`. Then all nodes that pass their gates read the contacts of all
/// nodes until each has reported `done`.
struct NodeContacts {
  /// Also the frame before frame 0, which has no contacts.
  static constexpr std::uint64_t no_frame = ~std::uint64_t{0};

  // Written by the node.
  const Host* host = nullptr;              ///< set once; read between frames, and by the server while the node waits
  const RegionObjects* objects = nullptr;  ///< what the node knows; as `host`, but the server reads it between frames
  HostOwnedStates host_states;             ///< see HostOwnedStates for its rules
  GhostUpdates ghost_updates;              ///< see GhostUpdates for its rules
  HandOverList hand_overs;                 ///< see HandOverList for its rules
  /// Read by all nodes.
  alignas(64) std::uint64_t frame = no_frame;          ///< the frame of the lists
  const narrow_phase::PairContact* touches = nullptr;  ///< in the order of detection
  const narrow_phase::Body* bodies = nullptr;          ///< poses at the time of the tests; null: the next two
  const ObjectRow* rows = nullptr;                     ///< by slot; of contacts that the server received as messages
  const ObjectOrigin* origins = nullptr;               ///< by slot
  base::FlatList<FoundContact> found;                  ///< parallel to keys
  base::FlatList<std::uint8_t> begun;  ///< parallel to keys: 1 if the pair was not in contact in the frame before; set
                                       ///< by the node, corrected by the server
  alignas(64) ContactSummary summary;  ///< of the lists below; the server reads it before it notifies any node
  BorderCopies border_copies;          ///< the same
  // Read by the server where it reads more than the summary.
  base::FlatList<std::uint64_t> keys;       ///< base::PairSort::key, ascending
  std::uint64_t frame_before = no_frame;    ///< the frame of keys_before
  base::FlatList<std::uint32_t> beginning;  ///< positions of the keys that are not in keys_before
  /// Those that another node may have found in the frame before, by key.
  base::FlatList<BorderContact> border_beginning;
  base::FlatList<std::uint64_t> ending;         ///< those of keys_before that are not in keys, ascending
  base::FlatList<std::uint64_t> border_ending;  ///< those that another node may have found in this frame, ascending
  // Read by the node, or later by the server.
  /// Parallel to ending: their positions in keys_before; empty after unlist().
  base::FlatList<std::uint32_t> ending_at;
  base::FlatList<std::uint64_t> keys_before;         ///< keys of the frame before, ascending
  base::FlatList<FoundContact> found_before;         ///< parallel to keys_before
  base::FlatList<UserContact> user_contacts;         ///< by key
  base::FlatList<UserContact> user_contacts_before;  ///< of the frame before
  base::FlatList<UserContact> user_contacts_ending;  ///< those of user_contacts_before that are in ending
  PeerLists for_peers;  ///< positions in keys, ascending, of the contacts that concern each other node

  // Written by the server. On its own cache lines: other nodes read the fields above while this node writes here.
  alignas(64) const OutputMerge* output_merge = nullptr;  ///< the output lists of which the node writes a slice
  std::uint32_t share = 0;                                ///< number of the slice
  ReadGate gate;                 ///< for the contacts of other nodes; opened before `frame_end`
  ReadGate hand_over_gate;       ///< for the hand-overs of other nodes; opened before `frame_end`
  messages::FrameEndRecord end;  ///< what the announcement of `frame_end` says to the node

  NodeQueries queries;  ///< see NodeQueries for its rules
  /// The frame before, for the models of this node; null: there is none, or the node hosts nothing. Within a process
  /// the server writes it before `frame_begin`, and never again for a node that is lost: it is Publications::sensed.
  /// Otherwise the node has made it of what it received.
  const queries::RecordedFrame* sensed = nullptr;

  // Written by the other nodes: which of them have listed something for this one.
  alignas(64) SenderSet ghost_senders;
  SenderSet contact_senders, hand_over_senders;
  /// Of the node's thread, which other nodes ring after hand-overs that it waits for; null: no thread sleeps. Set once.
  link::Doorbell* bell = nullptr;

  StepReport report;  ///< see StepReport for its rules

  /// By the node: clears its part for the frame. The contacts of the frame before are kept, also if a frame is started
  /// twice.
  void start(std::uint64_t new_frame);
  /// By the node: fills begun, beginning, ending and the summary. `was_alone(found)`: no other node can have found this
  /// contact in the frame before. `is_alone(key, found)`: no other node can have found this contact of the frame before
  /// in this frame. Both may return false when in doubt; the server then compares the pair.
  template <class WasAlone, class IsAlone>
  void compare(WasAlone was_alone, IsAlone is_alone);
  /// By the server, or by the node when the server says so, after compare(): the contacts at these positions in keys,
  /// ascending, are not in the list of contacts (WorldConfig::deepest_contacts). They are removed, as if the node had
  /// not found them; those of the frame before end.
  void unlist(std::span<const std::uint32_t> positions);
  Phase phase(std::uint32_t position) const noexcept { return begun[position] != 0 ? Phase::begin : Phase::persist; }
  /// Calls each(key, position, phase) for all, in order.
  template <class Each>
  void visit(Each each) const {
    constexpr std::uint32_t ahead = 10;
    const auto count = static_cast<std::uint32_t>(keys.size());
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t soon = std::min(i + ahead, count - 1);
      prefetch(found[soon]);
      each(keys[i], i, phase(i));
    }
  }
  /// Copies a contact. Sets `phase` instead of reading that of `from`, which its node may be writing.
  static void copy(const Contact& from, Phase phase, Contact& to) noexcept {
    to.a = from.a;
    to.b = from.b;
    to.phase = phase;
    std::memcpy(&to.depth, &from.depth, sizeof(Contact) - offsetof(Contact, depth));
  }
  /// Writes a contact of `found`.
  void write(const FoundContact& one, Phase phase, Contact& to) const noexcept {
    if (bodies == nullptr) {
      assemble(touches[one.touch], side(one.slot_a), side(one.slot_b), phase, to);
      return;
    }
    assemble(touches[one.touch], bodies[one.body_a], bodies[one.body_b], phase, to);
  }
  static void assemble(const narrow_phase::PairContact& touch, const narrow_phase::Body& a, const narrow_phase::Body& b,
                       Phase phase, Contact& to) noexcept {
    assemble(touch, side(a), side(b), phase, to);
  }
  /// Sets all that a contact states of its two objects except for their numbers: a function of these and of its point.
  static void complete(Contact& to, const ObjectRow& row_a, const ObjectOrigin& origin_a, const ObjectRow& row_b,
                       const ObjectOrigin& origin_b) noexcept {
    complete(to, side(row_a, origin_a), side(row_b, origin_b));
  }
  /// Prefetches what write() reads.
  void prefetch(const FoundContact& one) const noexcept {
    base::prefetch_for_read(&touches[one.touch]);
    if (bodies == nullptr) {
      base::prefetch_for_read(&rows[one.slot_a]);
      base::prefetch_for_read(&rows[one.slot_b]);
      base::prefetch_for_read(&origins[one.slot_a]);
      base::prefetch_for_read(&origins[one.slot_b]);
      return;
    }
    base::prefetch_for_read(&bodies[one.body_a]);
    base::prefetch_for_read(&bodies[one.body_b]);
  }
  /// Prefetches the addresses of the lists that prefetch(), write() and phase() read.
  void prefetch_lists() const noexcept {
    base::prefetch_for_read(&frame);
    base::prefetch_for_read(&begun);
  }
  /// After the lists of the summary have changed.
  void summarize() noexcept {
    summary = {static_cast<std::uint32_t>(keys.size()),     static_cast<std::uint32_t>(beginning.size()),
               border_copies.copy(border_beginning.span()), ending.span(),
               border_copies.copy(border_ending.span()),    begun.data()};
  }
  /// Prefetches what summarize() writes, for reading.
  void prefetch_summary() const noexcept {
    base::prefetch_object(summary);
    base::prefetch_object(border_copies);
  }

 private:
  void compare_keys();
  void end_unlisted(std::span<const std::uint32_t> positions);
  /// What a contact states of one of its two objects.
  struct Side {
    ObjectNumber number;
    std::uint32_t generation;
    std::uint16_t layer;
    std::uint64_t user_data;
    const Vec3d& position;
  };
  static Side side(const narrow_phase::Body& body) noexcept {
    return {body.number, body.generation, body.layer, body.user_data, body.pose.position};
  }
  static Side side(const ObjectRow& row, const ObjectOrigin& origin) noexcept {
    return {row.object.number, row.object.generation, row.layer, origin.user_data, row.pose.position};
  }
  Side side(std::uint32_t slot) const noexcept { return side(rows[slot], origins[slot]); }
  static void assemble(const narrow_phase::PairContact& touch, const Side& a, const Side& b, Phase phase,
                       Contact& to) noexcept {
    to.a = a.number;
    to.b = b.number;
    to.phase = phase;
    to.depth = touch.depth;
    to.normal = touch.normal;
    to.toi = 1;
    to.point = in_world(touch, a.position);
    complete(to, a, b);
  }
  static void complete(Contact& to, const Side& a, const Side& b) noexcept {
    to.arm_a = to_float(to.point - a.position);
    to.arm_b = to_float(to.point - b.position);
    to.generation_a = a.generation;
    to.generation_b = b.generation;
    to.user_data_a = a.user_data;
    to.user_data_b = b.user_data;
    to.child_a = to.child_b = 0;
    to.layer_a = a.layer;
    to.layer_b = b.layer;
    to.flags = 0;
  }
  static Vec3d in_world(const narrow_phase::PairContact& touch, const Vec3d& origin) noexcept {
    return {origin.x + static_cast<double>(touch.point.x), origin.y + static_cast<double>(touch.point.y),
            origin.z + static_cast<double>(touch.point.z)};
  }
};

template <class WasAlone, class IsAlone>
void NodeContacts::compare(WasAlone was_alone, IsAlone is_alone) {
  compare_keys();
  for (const std::uint32_t position : beginning) {
    if (!was_alone(found[position])) {
      border_beginning.push_back({keys[position], position});
    }
  }
  for (const std::uint32_t position : ending_at) {
    if (!is_alone(keys_before[position], found_before[position])) {
      border_ending.push_back(keys_before[position]);
    }
  }
  summarize();
}

}  // namespace ringfence::nodes
