#pragma once

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
/// single node does. Memory: 52 bytes per contact, kept. Belongs to one role.
class NodeContactOrder {
 public:
  void reserve(std::size_t contacts) {
    order_.reserve(contacts), sources_.reserve(contacts), merged_.reserve(contacts);
  }
  void reserve_rarely_used(std::size_t contacts) {
    order_.reserve_rarely_used(contacts), sources_.reserve_rarely_used(contacts);
    merged_.reserve_rarely_used(contacts);
  }
  /// Clears the order. The following add() calls refer to these contacts, by node number; they outlive the order.
  void start(std::span<NodeContacts* const> node_contacts) {
    node_contacts_ = node_contacts;
    order_.clear();
    sources_.clear();
    lists_ = 0;
  }
  /// Adds the contact at that position of the node's list. Precondition: positions ascend within a node, and nodes are
  /// added one after the other.
  void add(NodeNumber node, std::uint32_t position) { add(node, position, node_contacts_[node]->keys[position]); }
  void add(NodeNumber node, std::uint32_t position, std::uint64_t key) {
    if (order_.size() == 0 || key <= last_) {
      last_list_ = order_.size();
      ++lists_;
    }
    last_ = key;
    order_.add(key);
    sources_.push_back({node, position});
  }
  /// Sorts. Duplicates of a pair, if there are any, follow each other.
  void sort() {
    if (lists_ > 2) {
      order_.sort();
    } else if (lists_ == 2) {
      merge();
    }
  }
  std::size_t size() const noexcept { return order_.size(); }
  std::uint64_t key(std::size_t i) const noexcept { return order_.added(place(i)); }
  NodeNumber node(std::size_t i) const noexcept { return sources_[place(i)].node; }
  std::uint32_t position(std::size_t i) const noexcept { return sources_[place(i)].position; }
  /// Calls visit(key, node, position, phase) for each, in order.
  template <class Visit>
  void visit(Visit each) const {
    // Each stage reads what the one before has prefetched.
    constexpr std::size_t ahead = 10;
    for (std::size_t i = 0; i < size() + 4 * ahead; ++i) {
      if (i < size()) {
        const std::size_t at = place(i);
        base::prefetch_for_read(&sources_[at]);
        order_.prefetch_added(at);
      }
      if (const Source* source = behind(i, ahead)) {
        node_contacts_[source->node]->prefetch_lists();
      }
      if (const Source* source = behind(i, 2 * ahead)) {
        base::prefetch_for_read(&node_contacts_[source->node]->found[source->position]);
        base::prefetch_for_read(&node_contacts_[source->node]->begun[source->position]);
      }
      if (const Source* source = behind(i, 3 * ahead)) {
        node_contacts_[source->node]->prefetch(node_contacts_[source->node]->found[source->position]);
      }
      if (const Source* source = behind(i, 4 * ahead)) {
        each(key(i - 4 * ahead), source->node, source->position, node_contacts_[source->node]->phase(source->position));
      }
    }
  }

 private:
  struct Source {
    NodeNumber node;
    std::uint32_t position;
  };
  /// The source of contact i - `by`; null if there is none.
  const Source* behind(std::size_t i, std::size_t by) const noexcept {
    return i >= by && i - by < size() ? &sources_[place(i - by)] : nullptr;
  }
  std::size_t place(std::size_t i) const noexcept { return lists_ > 2 ? order_.at(i) : lists_ == 2 ? merged_[i] : i; }

  /// Merges two lists without a branch, because which one has the lesser key is random.
  void merge() {
    const std::size_t end = order_.size();
    merged_.resize(end);
    std::size_t p = 0, q = last_list_, i = 0;
    while (p < last_list_ && q < end) {
      const std::size_t second = order_.added(q) < order_.added(p) ? 1 : 0;
      merged_[i++] = static_cast<std::uint32_t>(p + ((q - p) & (0 - second)));
      q += second;
      p += 1 - second;
    }
    for (; p < last_list_; ++p) merged_[i++] = static_cast<std::uint32_t>(p);
    for (; q < end; ++q) merged_[i++] = static_cast<std::uint32_t>(q);
  }

  std::span<NodeContacts* const> node_contacts_;
  base::PairSort order_;
  base::FlatList<Source> sources_;  ///< in the order of the add() calls
  std::uint64_t last_ = 0;
  std::size_t lists_ = 0;                 ///< ascending lists among the keys; those of several nodes may be one
  std::size_t last_list_ = 0;             ///< the first key of the last of them
  base::FlatList<std::uint32_t> merged_;  ///< of two lists: places of the add() calls, in order of (a, b)
};

}  // namespace ringfence::nodes
