#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "messages/records.hpp"
#include "nodes/contact_order.hpp"
#include "nodes/findings.hpp"
#include "nodes/flat_list.hpp"
#include "nodes/object_table.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// The server's account of contacts: takes what the CD nodes found, merges it in order of (a, b), and tells by the
/// frame before which contacts began, go on or ended.
///
/// Eight bytes a contact are put in order (nothing is to be done where one node found all, as it tells them in order);
/// what is large follows when the order is known: written by the server, or by the node that found it (Findings). A
/// contact is written once, into the list that the embedder reads. Merging the nodes' runs by a heap took twice as
/// long: their numbers take turns at random. Two frames are kept, by parity: the last one stays readable while the next
/// is made. Threads: belongs to the server role; const calls for the last frame from the facade. Memory: grows to the
/// largest frame.
class ContactLedger {
 public:
  ContactLedger(std::size_t nodes, std::size_t contacts);

  /// From the next begin() on there are so many nodes.
  void resize(std::size_t nodes) { runs_.resize(nodes); }
  /// Empties C(frame) and what has been received.
  void begin(std::uint64_t frame);
  /// The next contact that `node` found; `key` is ContactOrder::key of the two objects' numbers.
  void receive(NodeNumber node, std::uint64_t key, const messages::CollisionRecord& record) {
    runs_[node].own.keys.push_back(key);
    runs_[node].records.push_back(record);
  }
  /// All that `node` found, in place of the above.
  void receive(NodeNumber node, Findings& findings) noexcept { runs_[node].shared = &findings; }
  std::size_t received(NodeNumber node) const noexcept { return runs_[node].keys().size(); }

  /// Puts the keys of what was received in order and tells began and ended ones; contacts(frame) are not written yet.
  /// Returns the pairs that two nodes found: always 0, unless a bug made two nodes own one pair; the surplus is
  /// dropped.
  std::uint64_t merge();
  /// After merge(): writes contacts and found, with the poses of received ones from `rows` (by slot). Unless `all`, it
  /// leaves to nodes that share their findings what concerns nobody else; written() then lists the others.
  void write(std::span<const ObjectRow> rows, bool all);
  /// After write(): one bit a contact of the frame, in order, whether it is written.
  std::span<const std::uint64_t> written() const noexcept { return written_; }
  /// The frame is complete, and of what was left to nodes these have been lost since: writes it, to where they do not
  /// write any more.
  void take_over(std::span<const NodeNumber> lost);
  /// No lost node's thread is left.
  void forget_lost() noexcept { retired_.clear(); }

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
  /// After merge().
  std::size_t live() const noexcept { return editions_[frame_ & 1].live.keys.size(); }
  std::uint64_t began() const noexcept { return began_; }

  /// After merge(): which of the contacts that `node` found persist, 64 a word, in the order of its run. Of a node that
  /// shares its findings, nothing: it is told by their ranks.
  std::span<const std::uint64_t> persists(NodeNumber node) const noexcept { return runs_[node].persists; }

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
  /// What one node found, in order of (a, b).
  struct Run {
    Findings* shared = nullptr;
    Findings own;  ///< of a node that sends messages: keys and ranks
    FlatList<messages::CollisionRecord> records;
    std::vector<std::uint64_t> persists;
    std::size_t first = 0;  ///< of its contacts among all that were received

    const FlatList<std::uint64_t>& keys() const noexcept { return shared != nullptr ? shared->keys : own.keys; }
    FlatList<std::uint32_t>& ranks() noexcept { return shared != nullptr ? shared->ranks : own.ranks; }
  };

  void gather_keys();
  void follow(std::size_t received, std::uint64_t key, std::size_t& old);
  void end_until(std::size_t& old, std::uint64_t key);
  void write_shared(NodeNumber node, std::size_t i);
  void write_received(NodeNumber node, std::span<const ObjectRow> rows);
  void write_ended();
  void note_written(std::uint32_t rank) noexcept { written_[rank / 64] |= std::uint64_t{1} << (rank % 64); }

  std::vector<Run> runs_;           ///< by node
  ContactOrder order_;              ///< of what was received
  FlatList<NodeNumber> finders_;    ///< parallel to it
  bool ascending_ = true;           ///< it came in order
  FlatList<std::uint32_t> ending_;  ///< of the contacts of the frame before
  std::vector<std::uint64_t> written_;
  std::uint64_t began_ = 0;
  bool left_to_nodes_ = false;  ///< in this frame
  Edition editions_[2];
  std::vector<List> retired_;  ///< where lost nodes may still write
  std::uint64_t frame_ = 0;
};

}  // namespace ringfence::nodes
