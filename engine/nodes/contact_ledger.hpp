#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "messages/records.hpp"
#include "nodes/contact_order.hpp"
#include "nodes/flat_list.hpp"
#include "nodes/object_table.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// The slots of a contact's two objects, and the node that found it.
struct Found {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  NodeNumber by = 0;
};

/// The server's account of contacts: takes what the CD nodes found, merges it in order of (a, b), and tells by the
/// frame before which contacts began, go on or ended.
///
/// Eight bytes a contact are put in order (nothing is to be done where one node found all, as it tells them in order);
/// what is large follows when the order is known, fetched ahead. A contact is written once, into the list that the
/// embedder reads. Merging the nodes' runs by a heap took twice as long: their numbers take turns at random. Two frames
/// are kept, by parity: the last one stays readable while the next is made. Threads: belongs to the server role; const
/// calls for the last frame from the facade. Memory: grows to the largest frame.
class ContactLedger {
 public:
  ContactLedger(std::size_t nodes, std::size_t contacts);

  /// From the next begin() on there are so many nodes.
  void resize(std::size_t nodes) {
    received_.resize(nodes, 0);
    persists_.resize(nodes);
  }
  /// Empties C(frame) and what has been received.
  void begin(std::uint64_t frame);
  /// The next contact that `node` found; `key` is ContactOrder::key of the two objects' numbers.
  void receive(NodeNumber node, std::uint64_t key, const messages::CollisionRecord& record) {
    ascending_ &= key > last_key_;
    last_key_ = key;
    order_.add(static_cast<ObjectNumber>(key >> 32), static_cast<ObjectNumber>(key));
    records_.push_back(record);
    sources_.push_back({node, received_[node]++});
  }
  std::size_t received(NodeNumber node) const noexcept { return received_[node]; }
  /// Merges what was received, takes the poses from `rows` (by slot) and gives the phases. Returns the pairs that two
  /// nodes found: always 0, unless a bug made two nodes own one pair; the surplus is dropped.
  std::uint64_t merge(std::span<const ObjectRow> rows);

  /// Begin and persist contacts of the frame, in order of (a, b); parallel to keys() and found().
  std::span<const Contact> contacts(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].live.contacts.span();
  }
  std::span<const std::uint64_t> keys(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].live.keys.span();
  }
  std::span<const Found> found(std::uint64_t frame) const noexcept { return editions_[frame & 1].live.found.span(); }
  /// Contacts that ended in the frame, in order of (a, b); parallel to ended_keys() and ended_found().
  std::span<const Contact> ended(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].ended.contacts.span();
  }
  std::span<const std::uint64_t> ended_keys(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].ended.keys.span();
  }
  std::span<const Found> ended_found(std::uint64_t frame) const noexcept {
    return editions_[frame & 1].ended.found.span();
  }
  std::uint64_t began() const noexcept { return newcomers_.size(); }

  /// After merge(): which of the contacts that `node` found persist, 64 a word, in the order of its run.
  std::span<const std::uint64_t> persists(NodeNumber node) const noexcept { return persists_[node]; }

 private:
  struct List {
    FlatList<Contact> contacts;
    FlatList<std::uint64_t> keys;
    FlatList<Found> found;

    void reserve(std::size_t contacts);
    void clear() noexcept;
  };
  struct Edition {
    List live;
    List ended;
  };
  /// Who found a contact, and the how many-th it was of his.
  struct Source {
    NodeNumber node;
    std::uint32_t index;
  };

  std::uint64_t merge_keys();
  void follow(std::uint32_t received, std::uint64_t key, std::size_t& old);
  void end_until(std::size_t& old, std::uint64_t key);
  void write_contacts(std::span<const ObjectRow> rows);
  void write_ended();

  std::vector<std::uint32_t> received_;               ///< by node: how many
  std::vector<std::vector<std::uint64_t>> persists_;  ///< by node
  ContactOrder order_;                                ///< of what was received; so are records_ and sources_
  FlatList<messages::CollisionRecord> records_;
  FlatList<Source> sources_;
  std::uint64_t last_key_ = 0;
  bool ascending_ = true;              ///< so far it came in order
  FlatList<std::uint32_t> merged_;     ///< which of the received is the next by (a, b)
  FlatList<std::uint32_t> newcomers_;  ///< of merged_, that begin
  FlatList<std::uint32_t> ending_;     ///< of those of the frame before
  Edition editions_[2];
  std::uint64_t frame_ = 0;
};

}  // namespace ringfence::nodes
