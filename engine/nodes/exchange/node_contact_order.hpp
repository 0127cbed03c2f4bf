#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/pair_sort.hpp"
#include "base/prefetch.hpp"
#include "nodes/exchange/node_contacts.hpp"

namespace ringfence::nodes {

/// Contacts of several nodes in order of (a, b).
///
/// The lists of the nodes are sorted, but their numbers interleave at random: two lists are merged, but to merge more
/// costs more than a radix sort of 8-byte keys. Nothing is sorted if the lists already follow each other, as that of a
/// single node does. Memory: 56 bytes per contact, kept. Belongs to one role.
class NodeContactOrder {
 public:
  void reserve(std::size_t contacts) { added_.reserve(contacts), sorted_.reserve(contacts), keys_.reserve(contacts); }
  void reserve_rarely_used(std::size_t contacts) {
    added_.reserve_rarely_used(contacts), sorted_.reserve_rarely_used(contacts);
    keys_.reserve_rarely_used(contacts);
  }
  /// Clears the order. The following add() calls refer to these contacts, by node number; they outlive the order.
  void start(std::span<NodeContacts* const> node_contacts) {
    node_contacts_ = node_contacts;
    added_.clear();
    lists_ = 0;
  }
  /// Adds the contact at that position of the node's list. Precondition: positions ascend within a node, and nodes are
  /// added one after the other.
  void add(NodeNumber node, std::uint32_t position) {
    add_list(node, position, node_contacts_[node]->keys.span().subspan(position, 1));
  }
  /// The same for the contacts from a position on, with these keys, ascending.
  void add_list(NodeNumber node, std::uint32_t position, std::span<const std::uint64_t> keys) {
    if (keys.empty()) {
      return;
    }
    const std::size_t before = added_.size();
    if (before == 0 || keys.front() <= added_.back().key) {
      last_list_ = before;
      ++lists_;
    }
    added_.resize(before + keys.size());
    Entry* to = added_.data() + before;
    for (const std::uint64_t key : keys) {
      *to++ = {key, node, position++};
    }
  }
  /// Sorts. Duplicates of a pair, if there are any, follow each other.
  void sort() {
    if (lists_ == 2) {
      sorted_.resize(size());
      merge(added_.span(), last_list_, sorted_.data());
    } else if (lists_ > 2) {
      sort_by_keys();
    }
  }
  std::size_t size() const noexcept { return added_.size(); }
  std::uint64_t key(std::size_t i) const noexcept { return entries()[i].key; }
  NodeNumber node(std::size_t i) const noexcept { return entries()[i].node; }
  std::uint32_t position(std::size_t i) const noexcept { return entries()[i].position; }
  /// Calls visit(key, node, position, phase) for each, in order.
  template <class Visit>
  void visit(Visit each) const {
    // Each stage reads what the one before has prefetched.
    constexpr std::size_t ahead = 10;
    const std::size_t count = size();
    const Entry* const all = entries();
    const auto behind = [=](std::size_t i, std::size_t by) {
      return i >= by && i - by < count ? all + (i - by) : nullptr;
    };
    for (std::size_t i = 0; i < count + 3 * ahead; ++i) {
      if (const Entry* entry = behind(i, 0)) {
        node_contacts_[entry->node]->prefetch_lists();
      }
      if (const Entry* entry = behind(i, ahead)) {
        base::prefetch_for_read(&node_contacts_[entry->node]->found[entry->position]);
        base::prefetch_for_read(&node_contacts_[entry->node]->begun[entry->position]);
      }
      if (const Entry* entry = behind(i, 2 * ahead)) {
        node_contacts_[entry->node]->prefetch(node_contacts_[entry->node]->found[entry->position]);
      }
      if (const Entry* entry = behind(i, 3 * ahead)) {
        each(entry->key, entry->node, entry->position, node_contacts_[entry->node]->phase(entry->position));
      }
    }
  }

 private:
  struct Entry {
    std::uint64_t key;
    NodeNumber node;
    std::uint32_t position;
  };

  const Entry* entries() const noexcept { return lists_ > 1 ? sorted_.data() : added_.data(); }

  /// Merges the entries before and from `middle` on, without a branch on their keys, because which list has the next
  /// one is random; from both ends, because each step waits for the one before at its end. Of equal keys those of the
  /// first list come first.
  static void merge(std::span<const Entry> all, std::size_t middle, Entry* to) noexcept {
    std::size_t p = 0, q = middle, p_end = middle, q_end = all.size();
    while (p < p_end && q < q_end) {
      const std::size_t second = all[q].key < all[p].key ? 1 : 0;
      to[p + q - middle] = all[p + ((q - p) & (0 - second))];
      q += second;
      p += 1 - second;
      if (p == p_end || q == q_end) {
        break;
      }
      const std::size_t last = all[p_end - 1].key <= all[q_end - 1].key ? 1 : 0;
      to[p_end + q_end - middle - 1] = all[p_end - 1 + ((q_end - p_end) & (0 - last))];
      q_end -= last;
      p_end -= 1 - last;
    }
    Entry* const rest = to + (p + q - middle);
    std::copy(all.begin() + q, all.begin() + q_end, std::copy(all.begin() + p, all.begin() + p_end, rest));
  }

  void sort_by_keys() {
    keys_.clear();
    for (const Entry& entry : added_) {
      keys_.add(entry.key);
    }
    keys_.sort();
    sorted_.resize(size());
    for (std::size_t i = 0; i < size(); ++i) {
      sorted_[i] = added_[keys_.at(i)];
    }
  }

  std::span<NodeContacts* const> node_contacts_;
  base::FlatList<Entry> added_;   ///< in the order of the add() calls
  base::FlatList<Entry> sorted_;  ///< unused if they are one list
  base::PairSort keys_;           ///< of more than two lists
  std::size_t lists_ = 0;         ///< ascending lists among the entries; those of several nodes may be one
  std::size_t last_list_ = 0;     ///< the first entry of the last of them
};

}  // namespace ringfence::nodes
