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

/// A contact that the server has to tell somebody of, where it lies.
struct ContactNotice {
  std::uint64_t key = 0;                        ///< base::PairSort::key
  const NodeContacts* node_contacts = nullptr;  ///< that it is one of; null: it ended
  std::uint32_t position = 0;                   ///< in Findings::keys
  const Contact* ended = nullptr;               ///< as it was last
  FoundContact place;                           ///< where its parts are; not looked at if it ended
  Found found;
  Phase phase = Phase::begin;

  void write(Contact& to) const noexcept {
    if (node_contacts != nullptr) {
      node_contacts->write(position, place, phase, to);
    } else {
      NodeContacts::copy(*ended, phase, to);
    }
  }
};

/// The server's account of contacts: takes what the CD nodes found, tells by the frame before which contacts began, go
/// on or ended, and sees that the list of all is written in order of (a, b).
///
/// Nodes that share their findings tell by themselves what began and ended within their regions; of those it compares
/// only what lies at borders, and what they found is put in order and written by as many of them as there are. It
/// compares everything where that would not be the whole truth: where a node sends messages or is in its first frame,
/// where another is gone or lost since the frame before, or two found the same. It writes the lists itself where no
/// node shares. Two frames are kept, by parity: the last one stays readable while the next is made.
///
/// Threads: belongs to the server role; const calls for the last frame from the facade. Memory: grows to the largest
/// frame.
class ContactLedger {
 public:
  ContactLedger(std::size_t nodes, std::size_t contacts);

  /// From the next begin() on there are so many nodes.
  void resize(std::size_t nodes);
  /// Empties C(frame) and what has been received.
  void begin(std::uint64_t frame);
  /// The next contact that `node` found, by (a, b); numbers and poses are those of the two slots in `rows`.
  void receive(NodeNumber node, const messages::CollisionRecord& record, std::span<const ObjectRow> rows);
  /// All that `node` found, in place of the above.
  void receive(NodeNumber node, NodeContacts& node_contacts) noexcept {
    runs_[node].shared = &node_contacts;
    node_contacts.prefetch_summary();
  }
  std::size_t received(NodeNumber node) const noexcept { return runs_[node].node_contacts().keys.size(); }
  /// Whether all nodes share their findings, and all have been received.
  bool all_share() const noexcept {
    return std::all_of(runs_.begin(), runs_.end(), [](const Run& run) { return run.shared != nullptr; });
  }

  /// All is received: finds out what began and ended.
  void compare();
  /// After compare(): has the lists written, by nodes that share their findings if there are such.
  void share_out();
  /// After share_out(): the node is lost. What it was to write and had not begun to is written.
  void lose(NodeNumber node);
  /// Every node that is not lost has told. False while one that is lost is still writing; else C(frame) is complete.
  bool complete();
  /// After complete(): how often a pair was found beyond once: always 0, unless a bug made two nodes own it. The
  /// surplus is dropped.
  std::uint64_t duplicates() const noexcept { return duplicates_; }

  /// After compare(): the contacts that user nodes have to be told of, or `all`, in order of (a, b). Until the nodes
  /// begin the next frame.
  std::span<const ContactNotice> notices(bool all);
  /// After compare(): the same for contacts that ended, geometry and poses being those of the last contact.
  std::span<const ContactNotice> ended_notices(bool all);
  /// After compare(): which of the contacts that `node` sent persist, 64 a word, in the order of its run; nothing of a
  /// node that shares its findings.
  std::span<const std::uint64_t> persists(NodeNumber node) const noexcept { return runs_[node].persists; }

  /// Begin and persist contacts of the frame, in order of (a, b); parallel to keys() and found(). Of the frame that is
  /// being made only after complete().
  std::span<const Contact> contacts(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].live.contacts.span();
  }
  std::span<const std::uint64_t> keys(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].live.keys.span();
  }
  std::span<const Found> found(std::uint64_t frame) const noexcept { return editions_[frame & 1].live.found.span(); }
  /// Contacts that ended in the frame, in order of (a, b); parallel to ended_keys(). Of the frame that is being made
  /// only after complete().
  std::span<const Contact> ended(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].ended.contacts.span();
  }
  std::span<const std::uint64_t> ended_keys(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].ended.keys.span();
  }
  /// After compare(): how many were found, doubled ones too.
  std::size_t size() const noexcept { return size_; }
  /// After compare(): how many ended.
  std::size_t ends() const noexcept { return ends_; }
  /// After complete().
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
  /// What one node found, in order of (a, b).
  struct Run {
    NodeContacts* shared = nullptr;
    std::unique_ptr<NodeContacts> own = std::make_unique<NodeContacts>();  ///< of a node that sends messages
    base::FlatList<Contact> contacts;                                      ///< those of `own`, in its order
    std::vector<std::uint64_t> persists;

    NodeContacts& node_contacts() const noexcept { return shared != nullptr ? *shared : *own; }
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
  std::vector<NodeContacts*> node_contacts_;  ///< of the frame, by node
  std::vector<NodeContacts*>
      compared_;  ///< those of the frame before that its contacts are made of; null: it sent messages
  NodeContactOrder order_;
  base::PairSort ending_order_;
  base::FlatList<std::uint64_t> gone_;  ///< keys that ended, ascending; where nodes compared they have them
  base::FlatList<std::uint64_t>
      passed_;  ///< where nodes compared: of what they find no more, what others found, ascending
  std::vector<std::span<const std::uint64_t>> endings_;  ///< Listing::endings
  OutputMerge output_merge_;
  OutputMergeScratch scratch_;
  base::FlatList<ContactNotice> notices_, ended_notices_;
  bool by_nodes_ = false;  ///< who compared in this frame
  std::size_t size_ = 0;
  std::size_t ends_ = 0;
  std::uint64_t began_ = 0;
  std::uint64_t duplicates_ = 0;
  Edition editions_[2];
  std::uint64_t frame_ = 0;
};

}  // namespace ringfence::nodes
