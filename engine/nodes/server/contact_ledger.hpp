#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/pair_sort.hpp"
#include "messages/records.hpp"
#include "nodes/exchange/node_contact_order.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/exchange/output_merge.hpp"
#include "nodes/server/object_table.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// A contact that the server reports to the hosts of its objects, and the place where the contact is stored.
struct ContactNotice {
  std::uint64_t key = 0;                        ///< base::PairSort::key of the pair
  const NodeContacts* node_contacts = nullptr;  ///< source of the contact; null if it ended
  std::uint32_t position = 0;                   ///< index in NodeContacts::keys; unused if it ended
  const Contact* ended = nullptr;               ///< if it ended: the contact of the frame before; otherwise null
  FoundContact place;                           ///< its entry in NodeContacts::found; unused if it ended
  Found found;
  Phase phase = Phase::begin;

  /// Writes the contact, with its phase, to `to`.
  void write(Contact& to) const noexcept {
    if (node_contacts != nullptr) {
      node_contacts->write(position, place, phase, to);
    } else {
      NodeContacts::copy(*ended, phase, to);
    }
  }
};

/// The server's record of contacts. It collects the contacts that the CD nodes found and compares them with those of
/// the frame before: this determines which contacts began, persist or ended. The output lists are then written in order
/// of (a, b).
///
/// A node either shares its contacts, in the memory of NodeContacts, or sends them in messages. A node that shares them
/// compares its contacts itself. Then the ledger compares only contacts at borders, and the nodes write the output
/// lists. The ledger compares all contacts if the nodes' comparisons are incomplete: when a node sends messages or is
/// in its first frame, when a node has left or was lost since the frame before, or when two nodes found the same pair
/// in the frame before. It writes the lists itself if no node shares contacts.
///
/// Order of calls in a frame: begin(), receive(), compare(), share_out(), complete(). Two frames are kept, by parity:
/// the last one stays readable while the next is made.
///
/// Threads: belongs to the server role; the facade may call const functions for the last frame. Memory: grows to the
/// largest frame.
class ContactLedger {
 public:
  /// Reserves memory for `contacts` contacts a frame. More may be added, at the cost of an allocation.
  ContactLedger(std::size_t nodes, std::size_t contacts);

  /// Sets the number of nodes from the next begin() on.
  void resize(std::size_t nodes);
  /// Clears C(frame) and everything received.
  void begin(std::uint64_t frame);
  /// Adds a contact that `node` sent in a message. Its numbers and poses are those of its two slots in `rows`. A node
  /// sends its contacts in order of (a, b): returns false and adds nothing if (a, b) is below the pair that the node
  /// sent before, if a slot is not in `rows`, or if a is not below b.
  bool receive(NodeNumber node, const messages::CollisionRecord& record, std::span<const ObjectRow> rows);
  /// Adds all contacts of a node that shares them. `node_contacts` outlives the frame.
  void receive(NodeNumber node, NodeContacts& node_contacts) noexcept {
    runs_[node].shared = &node_contacts;
    node_contacts.prefetch_summary();
  }
  /// Number of contacts of `node`.
  std::size_t received(NodeNumber node) const noexcept { return runs_[node].node_contacts().keys.size(); }
  /// Whether all nodes share their contacts, and all have been received.
  bool all_share() const noexcept {
    return std::all_of(runs_.begin(), runs_.end(), [](const Run& run) { return run.shared != nullptr; });
  }

  /// Determines which contacts began and ended. All contacts must have been received.
  void compare();
  /// After compare(): opens the gates of the nodes that share contacts, which then write the output lists. If no node
  /// shares contacts, this call writes them.
  void share_out();
  /// After share_out(), when a node is lost: writes its slice, unless the node has already started to write it.
  void lose(NodeNumber node);
  /// Call it when every node that is not lost is done, until it returns true: then C(frame) is complete. Returns false
  /// while a lost node is still writing.
  bool complete();
  /// After share_out(), when all nodes are lost and the thread of one of them has stopped while it was writing: writes
  /// C(frame) again into other memory. The memory that such a thread may still access is kept until free_abandoned().
  void write_again();
  /// Precondition: the threads of all lost nodes have ended, and no frame is running.
  void free_abandoned() noexcept { abandoned_.clear(); }
  /// After complete(): number of duplicates, which were dropped. It is 0 unless a bug made two nodes own one pair.
  std::uint64_t duplicates() const noexcept { return duplicates_; }

  /// After compare(): the contacts that concern user nodes, or all contacts if `all`, in order of (a, b), each pair
  /// once. Valid until the next call, and at most until the nodes begin the next frame.
  std::span<const ContactNotice> notices(bool all);
  /// After compare(): the same for ended contacts, with the geometry and poses of the frame before. If the ledger
  /// compared all contacts, the result is always all ended contacts.
  std::span<const ContactNotice> ended_notices(bool all);
  /// After compare(): which of the contacts that `node` sent persist. Bit i of word w is 1 if contact 64 w + i of its
  /// list persists. Empty for a node that shares its contacts.
  std::span<const std::uint64_t> persists(NodeNumber node) const noexcept { return runs_[node].persists; }

  /// Begin and persist contacts of the current frame or of the one before, in order of (a, b); parallel to keys() and
  /// found(). For the current frame only after complete().
  std::span<const Contact> contacts(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].live.contacts.span();
  }
  std::span<const std::uint64_t> keys(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].live.keys.span();
  }
  std::span<const Found> found(std::uint64_t frame) const noexcept { return editions_[frame & 1].live.found.span(); }
  /// Contacts that ended in the current frame or in the one before, in order of (a, b); parallel to ended_keys(). For
  /// the current frame only after complete().
  std::span<const Contact> ended(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].ended.contacts.span();
  }
  std::span<const std::uint64_t> ended_keys(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].ended.keys.span();
  }
  /// After compare(): number of contacts, duplicates included.
  std::size_t size() const noexcept { return size_; }
  /// After compare(): number of ended contacts.
  std::size_t ends() const noexcept { return ends_; }
  /// After complete(): number of contacts that began.
  std::uint64_t began() const noexcept { return began_; }

 private:
  struct List {
    base::FlatList<Contact> contacts;
    base::FlatList<std::uint64_t> keys;
    base::FlatList<Found> found;

    void reserve(std::size_t contacts);
    void resize(std::size_t contacts);
  };
  struct Edition {
    List live;
    List ended;
  };
  /// Contacts of one node, in order of (a, b).
  struct Run {
    NodeContacts* shared = nullptr;
    std::unique_ptr<NodeContacts> own = std::make_unique<NodeContacts>();  ///< of a node that sends messages
    base::FlatList<Contact> contacts;                                      ///< of `own`, in its order
    std::vector<std::uint64_t> persists;

    NodeContacts& node_contacts() const noexcept { return shared != nullptr ? *shared : *own; }
  };

  /// The memory that threads of lost nodes may still access after write_again().
  struct Abandoned {
    std::unique_ptr<OutputMerge> output_merge;
    std::vector<NodeContacts*> node_contacts;
    std::vector<std::span<const std::uint64_t>> endings;
    base::FlatList<std::uint64_t> gone, passed;
    std::vector<Run> runs;
    Edition now, before;
  };

  List& now() noexcept { return editions_[frame_ & 1].live; }
  List& ended() noexcept { return editions_[frame_ & 1].ended; }
  const List& before() const noexcept { return editions_[(frame_ - 1) & 1].live; }
  void gather_node_contacts();
  bool nodes_have_compared() const noexcept;
  void compare_borders();
  void compare_all();
  void list_persisting();
  void list_user_notices();
  void list_ended_notice(std::uint64_t key, std::size_t& old);
  void drop_duplicates();

  std::vector<Run> runs_;                     ///< by node
  std::vector<NodeContacts*> node_contacts_;  ///< of this frame, by node
  std::vector<NodeContacts*> compared_;  ///< sources of the contacts of the frame before; null: the node sent messages
  NodeContactOrder order_;
  base::PairSort ending_order_;
  base::FlatList<std::uint64_t> gone_;  ///< keys that ended, ascending; unused if the nodes compared
  /// If the nodes compared: keys that ended at one node and that another node found, ascending. These contacts persist.
  base::FlatList<std::uint64_t> passed_;
  std::vector<std::span<const std::uint64_t>> endings_;                          ///< OutputMerge::endings
  std::unique_ptr<OutputMerge> output_merge_ = std::make_unique<OutputMerge>();  ///< nodes hold its address
  OutputMergeScratch scratch_;
  std::vector<Abandoned> abandoned_;
  bool written_again_ = false;  ///< write_again() was called in this frame
  base::FlatList<ContactNotice> notices_, ended_notices_;
  bool by_nodes_ = false;  ///< the nodes compared in this frame; otherwise the ledger
  std::size_t size_ = 0;
  std::size_t ends_ = 0;
  std::uint64_t began_ = 0;
  std::uint64_t duplicates_ = 0;
  Edition editions_[2];
  std::uint64_t frame_ = 0;
};

}  // namespace ringfence::nodes
