#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "messages/records.hpp"
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
/// Each node's run comes in order, so the merge compares keys and never sorts or hashes; what is large follows when the
/// order is known, fetched ahead. A contact is written once, into the list that the embedder reads. Two frames are
/// kept, by parity: the last one stays readable while the next is made. Threads: belongs to the server role; const
/// calls for the last frame from the facade. Memory: grows to the largest frame.
class ContactLedger {
 public:
  ContactLedger(std::size_t nodes, std::size_t contacts);

  /// From the next begin() on there are so many nodes.
  void resize(std::size_t nodes) {
    received_.resize(nodes);
    persists_.resize(nodes);
  }
  /// Empties C(frame) and what has been received.
  void begin(std::uint64_t frame);
  /// The next contact that `node` found; `key` is ContactOrder::key of the two objects' numbers.
  void receive(NodeNumber node, std::uint64_t key, const messages::CollisionRecord& record) {
    received_[node].keys.push_back(key);
    received_[node].records.push_back(record);
  }
  std::size_t received(NodeNumber node) const noexcept { return received_[node].keys.size(); }
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
  /// What a node found, in order.
  struct Received {
    FlatList<std::uint64_t> keys;
    FlatList<messages::CollisionRecord> records;
  };
  struct Run {
    const std::uint64_t* next;
    const std::uint64_t* end;
    NodeNumber node;
  };
  /// Where the next contact by (a, b) is: `index` in the run of `node`.
  struct Source {
    NodeNumber node;
    std::uint32_t index;
  };

  std::uint64_t merge_keys();
  void follow(const Run& run, std::uint64_t key, std::size_t& old);
  void end_until(std::size_t& old, std::uint64_t key);
  void write_contacts(std::span<const ObjectRow> rows);
  void write_ended();

  std::vector<Received> received_;                    ///< by node
  std::vector<std::vector<std::uint64_t>> persists_;  ///< by node
  std::vector<Run> heap_;
  FlatList<Source> sources_;           ///< of the contacts of this frame, by (a, b)
  FlatList<std::uint32_t> newcomers_;  ///< of these, that begin
  FlatList<std::uint32_t> ending_;     ///< of those of the frame before
  Edition editions_[2];
  std::uint64_t frame_ = 0;
};

}  // namespace ringfence::nodes
