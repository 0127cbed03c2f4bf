#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/prefetch.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "nodes/exchange/ghost_updates.hpp"
#include "nodes/exchange/host_owned_states.hpp"
#include "nodes/exchange/peer_lists.hpp"
#include "nodes/exchange/read_gate.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

class Host;
struct OutputMerge;

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

/// A contact of which user nodes have to be told, with all that the server needs for that in one piece.
struct UserContact {
  std::uint64_t key = 0;
  std::uint32_t position = 0;  ///< in Findings::keys
  FoundContact found;
};

/// A contact of which its node cannot tell alone whether it begins.
struct BorderContact {
  std::uint64_t key = 0;
  std::uint32_t position = 0;  ///< in Findings::keys
};

/// What a CD node found in a frame, in memory that all roles of a process share: in place of the messages `collision`,
/// `confirm` and, from node to node, `notify`.
///
/// A node lists its contacts by (a, b) and compares them with those of its frame before: what is in one list only has
/// begun or ended, or the pair has passed from or to another node. That it cannot have where one of the two objects
/// touched nothing but this node's region while the other list was made. The server compares only the rest, of all
/// nodes, with each other, and answers which go on. Then each node puts a stretch of the embedder's lists in order,
/// whoever found the contacts, and takes from the others' findings what concerns the objects that it hosts. So what the
/// server does for contacts is in proportion to those that change at borders and to those of avatars.
///
/// A contact has 136 bytes, of which most are the poses of two bodies that the node holds anyway. So it is put together
/// only where somebody reads it: at once where the node's own model does, else in the embedder's list.
///
/// Threads: one writer at a time, handed over by messages. The node writes its part before `narrow_done` and leaves it
/// as it is until the next `frame_begin`; the server reads it from then on, and writes its own part before `frame_end`;
/// then all nodes that the gate lets in read all findings until each has told.
struct NodeContacts {
  static constexpr std::uint64_t no_frame = ~std::uint64_t{0};  ///< the one before frame 0 too: nothing was found in it

  // The node's part.
  const Host* host = nullptr;  ///< the node's; set once. Read between frames, and while the node waits
  HostOwnedStates kept;        ///< states that it did not tell; its own rules hold
  GhostUpdates ghost_updates;  ///< what it tells the other nodes of these; likewise
  /// What all nodes look at.
  alignas(64) std::uint64_t frame = no_frame;          ///< that the lists are of
  const Contact* contacts = nullptr;                   ///< parallel to keys; null: made of the next two
  const narrow_phase::PairContact* touches = nullptr;  ///< as they were found
  const narrow_phase::Body* bodies = nullptr;          ///< as they stood when the pairs were tested
  base::FlatList<FoundContact> found;                  ///< parallel to keys
  base::FlatList<std::uint8_t> begun;  ///< parallel to keys: 1 where they were in contact nowhere in the frame before.
                                       ///< The node's word, corrected by the server
  /// What the server looks at of every node before it tells any.
  alignas(64) base::FlatList<std::uint64_t> keys;  ///< base::PairSort::key, ascending
  std::uint64_t frame_before = no_frame;           ///< that keys_before is of
  base::FlatList<std::uint32_t> beginning;         ///< positions of those of keys that are not among keys_before
  base::FlatList<BorderContact> border_beginning;  ///< those that another node may have found before, by key
  base::FlatList<std::uint64_t> ending;            ///< those of keys_before that are not among keys, ascending
  base::FlatList<std::uint64_t> border_ending;     ///< those that another node may have found now, ascending
  // The rest.
  base::FlatList<std::uint32_t> ending_at;           ///< parallel to ending: their positions in keys_before
  base::FlatList<std::uint64_t> keys_before;         ///< what the node found in the frame before, ascending
  base::FlatList<FoundContact> found_before;         ///< parallel to keys_before
  base::FlatList<UserContact> user_contacts;         ///< by key
  base::FlatList<UserContact> user_contacts_before;  ///< of the frame before
  base::FlatList<UserContact> user_contacts_ending;  ///< those of them that are among ending
  PeerLists for_peers;  ///< positions in keys of which the other nodes have to be told, ascending for each

  // The server's part. On lines of its own: others read the above while the node enters the gate and counts.
  alignas(64) const OutputMerge* output_merge = nullptr;  ///< of which the node writes a stretch
  std::uint32_t share = 0;                                ///< which
  bool nodes_exchange_contacts = false;  ///< nodes take what concerns them from for_peers; else the server tells them
  bool hosts_exchange_objects =
      false;      ///< with a map that is told now: nodes tell each other all that they host under it
  ReadGate gate;  ///< to the findings of others, before `frame_end`

  // The node's last part, before `told`.
  std::uint64_t duplicates = 0;  ///< contacts of the stretch whose pair another node found as well
  std::uint64_t taken = 0;       ///< contacts that it took from other nodes' findings

  /// The node: empties its part for the frame; what it found in the one before stays, also when a frame is begun twice.
  void start(std::uint64_t new_frame);
  /// The node: fills begun and what has begun and ended. `was_alone(found)`: no other node can have found that contact
  /// in the frame before; `is_alone(key, found)`: none can have found that one of the frame before in this one. The
  /// answer no is always right, but leaves it to the server to look.
  template <class WasAlone, class IsAlone>
  void compare(WasAlone was_alone, IsAlone is_alone);
  Phase phase(std::uint32_t position) const noexcept { return begun[position] != 0 ? Phase::begin : Phase::persist; }
  /// Calls each(key, position, phase) for all, in order.
  template <class Each>
  void visit(Each each) const {
    constexpr std::uint32_t ahead = 10;
    const auto count = static_cast<std::uint32_t>(keys.size());
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t soon = std::min(i + ahead, count - 1);
      prefetch(soon, found[soon]);
      each(keys[i], i, phase(i));
    }
  }
  /// Copies a contact to where it is read as a whole. Its own phase, which its node may be writing, is not looked at.
  static void copy(const Contact& from, Phase phase, Contact& to) noexcept {
    to.a = from.a;
    to.b = from.b;
    to.phase = phase;
    std::memcpy(&to.depth, &from.depth, sizeof(Contact) - offsetof(Contact, depth));
  }
  /// Writes the contact at that position of the list, which is `one`.
  void write(std::uint32_t position, const FoundContact& one, Phase phase, Contact& to) const noexcept {
    if (contacts != nullptr) {
      copy(contacts[position], phase, to);
      return;
    }
    assemble(touches[one.touch], bodies[one.body_a], bodies[one.body_b], phase, to);
  }
  static void assemble(const narrow_phase::PairContact& touch, const narrow_phase::Body& a, const narrow_phase::Body& b,
                       Phase phase, Contact& to) noexcept {
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
  /// Fetches what such a write() reads, which lies anywhere.
  void prefetch(std::uint32_t position, const FoundContact& one) const noexcept {
    if (contacts != nullptr) {
      base::prefetch_object(contacts[position]);
      return;
    }
    base::prefetch_for_read(&touches[one.touch]);
    base::prefetch_object(bodies[one.body_a]);
    base::prefetch_object(bodies[one.body_b]);
  }
  /// Fetches what compare_borders() of the ledger reads first.
  void prefetch_summary() const noexcept {
    base::prefetch_for_read(&keys);
    base::prefetch_for_read(&beginning);
    base::prefetch_for_read(&border_ending);
    base::prefetch_for_write(&output_merge);
  }

 private:
  void compare_keys();
  static Vec3d in_world(const narrow_phase::PairContact& touch, const narrow_phase::Body& a) noexcept {
    const Vec3d& origin = a.pose.position;
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
}

}  // namespace ringfence::nodes
