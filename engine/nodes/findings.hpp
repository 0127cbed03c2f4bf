#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "narrow_phase/narrow_phase.hpp"
#include "nodes/fetch.hpp"
#include "nodes/flat_list.hpp"
#include "nodes/gate.hpp"
#include "nodes/halo.hpp"
#include "nodes/kept_states.hpp"
#include "nodes/peer_runs.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

class Host;
struct Findings;

/// The slots of a contact's two objects, and the node that found it.
struct Found {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  NodeNumber by = 0;
};

/// A contact as the node that found it lists it.
struct FoundContact {
  std::uint32_t slot_a = 0;
  std::uint32_t slot_b = 0;
  std::uint32_t body_a = 0;  ///< which of Findings::bodies; not looked at where contacts are kept
  std::uint32_t body_b = 0;
  std::uint32_t touch = 0;  ///< which of Findings::touches
};

/// A stretch of the lists that the embedder reads: all contacts of a frame, whoever found them, whose keys are in
/// [first_key, end_key), and some of those that ended. See write_stretch().
struct Stretch {
  std::span<Findings* const> findings;  ///< of all nodes, by number
  std::uint64_t first_key = 0;
  std::uint64_t end_key = 0;
  Contact* contacts = nullptr;  ///< the lists of the frame, each from its beginning: the findings tell where to begin
  std::uint64_t* keys = nullptr;
  Found* found = nullptr;
  std::span<const std::uint64_t> ended_keys;   ///< of this stretch, ascending
  Contact* ended = nullptr;                    ///< parallel to it
  std::span<const std::uint64_t> keys_before;  ///< all of the frame before, ascending
  const Contact* contacts_before = nullptr;    ///< parallel to it
};

/// A contact of which user nodes have to be told, with all that the server needs for that in one piece.
struct OuterContact {
  std::uint64_t key = 0;
  std::uint32_t position = 0;  ///< in Findings::keys
  FoundContact found;
};

/// What a CD node found in a frame, in memory that all roles of a process share: in place of the messages `collision`,
/// `confirm` and, from node to node, `notify`.
///
/// A node lists its contacts by (a, b) and compares them with those of its frame before: what is in one list only may
/// have begun or ended, or the pair may have passed from or to another node. The server compares these few of all nodes
/// with each other, answers which begin for good, and cuts the embedder's list into one stretch a node. Then each node
/// puts its stretch in order, whoever found the contacts, and takes from the others' findings what concerns the objects
/// that it hosts. So what the server does for contacts is in proportion to those that change and to those of avatars.
///
/// A contact has 136 bytes, of which most are the poses of two bodies that the node holds anyway. So it is put together
/// only where somebody reads it: at once where the node's own model does, else in the embedder's list.
///
/// Threads: one writer at a time, handed over by messages. The node writes its part before `narrow_done` and leaves it
/// as it is until the next `frame_begin`; the server reads it from then on, and writes its own part before `frame_end`;
/// then all nodes that the gate lets in read all findings until each has told.
struct Findings {
  static constexpr std::uint64_t no_frame = ~std::uint64_t{0};  ///< the one before frame 0 too: nothing was found in it

  // The node's part.
  const Host* host = nullptr;         ///< the node's; set once. Read between frames, and while the node waits
  KeptStates kept;                    ///< states that it did not tell; its own rules hold
  Halo halo;                          ///< what it tells the other nodes of these; likewise
  std::uint64_t frame = no_frame;     ///< that the lists are of
  const Contact* contacts = nullptr;  ///< parallel to keys; null: made of the next two
  const narrow_phase::PairContact* touches = nullptr;  ///< as they were found
  const narrow_phase::Body* bodies = nullptr;          ///< as they stood when the pairs were tested
  FlatList<std::uint64_t> keys;                        ///< ContactOrder::key, ascending
  FlatList<FoundContact> found;                        ///< parallel to keys
  std::uint64_t frame_before = no_frame;               ///< that the next is of
  FlatList<std::uint64_t> keys_before;                 ///< what the node found in it, ascending
  FlatList<std::uint64_t> beginning;                   ///< those of keys that are not among keys_before, ascending
  FlatList<std::uint32_t> beginning_at;                ///< parallel to it: their positions in keys
  FlatList<std::uint64_t> ending;                      ///< those of keys_before that are not among keys, ascending
  FlatList<OuterContact> outer;                        ///< by key
  FlatList<OuterContact> outer_before;                 ///< of the frame before
  FlatList<OuterContact> outer_ending;                 ///< those of them that are among ending
  PeerRuns for_peers;  ///< positions in keys of which the other nodes have to be told, ascending for each

  // The server's part.
  FlatList<std::uint32_t> begun;  ///< which of keys were in contact nowhere in the frame before, ascending
  Stretch stretch;                ///< that the node writes
  bool peers_tell = false;        ///< nodes take what concerns them from for_peers; else the server tells them
  Gate gate;                      ///< to the findings of others, before `frame_end`

  // The node's last part, before `told`.
  std::uint64_t doubled = 0;  ///< contacts of the stretch whose pair another node found as well
  std::uint64_t taken = 0;    ///< contacts that it took from other nodes' findings

  /// The node: empties its part for the frame; what it found in the one before stays, also when a frame is begun twice.
  void start(std::uint64_t new_frame);
  /// The node: fills beginning, ending and outer_ending.
  void compare();
  /// Whether `position` is one of begun.
  bool begins(std::uint32_t position) const noexcept;
  /// Calls each(key, position, phase) for all, in order. Precondition: begun holds.
  template <class Each>
  void visit(Each each) const {
    constexpr std::uint32_t ahead = 10;
    const auto count = static_cast<std::uint32_t>(keys.size());
    const std::uint32_t* next = begun.begin();
    for (std::uint32_t i = 0; i < count; ++i) {
      fetch(std::min(i + ahead, count - 1));
      const bool begins = next != begun.end() && *next == i;
      next += begins ? 1 : 0;
      each(keys[i], i, begins ? Phase::begin : Phase::persist);
    }
  }
  /// Copies a contact to where it is read as a whole. Its own phase, which its node may be writing, is not looked at.
  static void copy(const Contact& from, Phase phase, Contact& to) noexcept {
    to.a = from.a;
    to.b = from.b;
    to.phase = phase;
    std::memcpy(&to.depth, &from.depth, sizeof(Contact) - offsetof(Contact, depth));
  }
  /// Writes the contact at that position of the list.
  void write(std::uint32_t position, Phase phase, Contact& to) const noexcept {
    if (contacts != nullptr) {
      copy(contacts[position], phase, to);
      return;
    }
    const FoundContact& one = found[position];
    put_together(touches[one.touch], bodies[one.body_a], bodies[one.body_b], phase, to);
  }
  static void put_together(const narrow_phase::PairContact& touch, const narrow_phase::Body& a,
                           const narrow_phase::Body& b, Phase phase, Contact& to) noexcept {
    to.a = a.number;
    to.b = b.number;
    to.phase = phase;
    to.depth = touch.depth;
    to.normal = touch.normal;
    to.reserved = 0;
    to.point = in_world(touch, a);
    to.pose_a = a.pose;
    to.pose_b = b.pose;
  }
  /// Contact::point of the contact at that position.
  Vec3d point(std::uint32_t position) const noexcept {
    const FoundContact& one = found[position];
    return contacts != nullptr ? contacts[position].point : in_world(touches[one.touch], bodies[one.body_a]);
  }
  /// Fetches what write() reads, which lies anywhere.
  void fetch(std::uint32_t position) const noexcept {
    if (contacts != nullptr) {
      fetch_lines(contacts[position]);
      return;
    }
    const FoundContact& one = found[position];
    fetch_to_read(&touches[one.touch]);
    fetch_lines(bodies[one.body_a]);
    fetch_lines(bodies[one.body_b]);
  }

 private:
  static Vec3d in_world(const narrow_phase::PairContact& touch, const narrow_phase::Body& a) noexcept {
    const Vec3d& origin = a.pose.position;
    return {origin.x + static_cast<double>(touch.point.x), origin.y + static_cast<double>(touch.point.y),
            origin.z + static_cast<double>(touch.point.z)};
  }
  template <class T>
  static void fetch_lines(const T& object) noexcept {
    const auto* from = reinterpret_cast<const std::byte*>(&object);
    for (std::size_t at = 0; at < sizeof(T) - 1; at += 64) {
      fetch_to_read(from + at);
    }
    fetch_to_read(from + sizeof(T) - 1);
  }
};

}  // namespace ringfence::nodes
