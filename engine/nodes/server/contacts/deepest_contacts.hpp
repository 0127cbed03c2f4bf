#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "nodes/exchange/node_contacts.hpp"

namespace ringfence::nodes {

/// Ranks the contacts of a frame for WorldConfig::deepest_contacts: a contact is listed if it is among the `limit`
/// deepest of either of its two objects, ties by (a, b). The others are unlisted.
///
/// Most objects have no more contacts than the limit, and all their contacts are listed. Only the contacts of the
/// others are ranked, and only as far as the limit needs (std::nth_element).
///
/// Threads: belongs to the server role. Memory: 8 bytes a slot, 16 a contact of an object that exceeds the limit.
class DeepestContacts {
 public:
  /// Ranks the contacts that all nodes found. `limit` is at least 1.
  void rank(std::uint32_t limit, std::span<NodeContacts* const> node_contacts);
  /// The contacts of a node that are unlisted, as ascending positions in NodeContacts::keys. Valid until rank().
  std::span<const std::uint32_t> unlisted(NodeNumber node) const noexcept {
    return unlisted_.span().subspan(from_[node], from_[node + 1] - from_[node]);
  }
  /// Number of unlisted contacts of all nodes.
  std::size_t size() const noexcept { return unlisted_.size(); }

 private:
  /// A contact as its objects rank it.
  struct Ranked {
    float depth;  ///< metres
    std::uint64_t key;

    bool operator<(const Ranked& other) const noexcept {
      return depth > other.depth || (depth == other.depth && key < other.key);
    }
  };
  /// An object with more contacts than the limit.
  struct Crowded {
    std::size_t begin, end;  ///< of its contacts in ranked_; `end` grows while they are added
  };
  static constexpr std::uint32_t not_crowded = ~std::uint32_t{0};

  void count(std::span<NodeContacts* const> node_contacts);
  bool is_doubtful(const FoundContact& found) const noexcept {
    return counts_[found.slot_a] > limit_ && counts_[found.slot_b] > limit_;
  }
  bool any_doubtful(std::span<NodeContacts* const> node_contacts) const noexcept;
  void list_crowded();
  void sort_crowded(std::span<NodeContacts* const> node_contacts);
  bool is_among_deepest(std::uint32_t slot, const Ranked& contact) const noexcept;

  std::uint32_t limit_ = 0;
  std::vector<std::uint32_t> counts_;  ///< by slot: number of contacts
  std::vector<std::uint32_t> places_;  ///< by slot: position in crowded_, or not_crowded
  std::vector<Crowded> crowded_;
  base::FlatList<Ranked> ranked_;  ///< by crowded object; the contact at the limit is where sorting would place it
  base::FlatList<std::uint32_t> unlisted_;
  std::vector<std::size_t> from_;  ///< by node, plus one: where its list begins in unlisted_
};

}  // namespace ringfence::nodes
