#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "nodes/exchange/node_contacts.hpp"

namespace ringfence::nodes {

/// Finds the contacts that ended at one CD node and began at another: these have moved between them, and persist.
///
/// A hash join: few contacts begin or end at a border, and fewer match, so only the matches are sorted. Cost:
/// proportional to the contacts. Memory: grows to the largest frame, 24 to 40 bytes for each that ended at a border.
/// Belongs to one role.
class BorderMatches {
 public:
  /// A contact that began, and was found to persist.
  struct Match {
    NodeNumber node = 0;
    std::uint32_t position = 0;  ///< in NodeContacts::keys of the node
  };

  /// For a new frame.
  void start() noexcept { endings_.clear(), matches_.clear(), passed_.clear(); }
  /// Adds contacts that ended, by base::PairSort::key.
  void add_endings(std::span<const std::uint64_t> keys) {
    for (const std::uint64_t key : keys) {
      endings_.push_back(key);
    }
  }
  /// After the last of them. Returns whether there are any: without, nothing matches.
  bool prepare();
  /// After prepare() returned true: finds which contacts that began at a node match.
  void match(NodeNumber node, std::span<const BorderContact> beginnings);
  /// After the last of them.
  void finish();

  /// In the order of match().
  std::span<const Match> matches() const noexcept { return matches_.span(); }
  /// After finish(): their keys, ascending, each once.
  std::span<const std::uint64_t> passed() const noexcept { return passed_.span(); }

 private:
  std::size_t place_of(std::uint64_t key) const noexcept;

  base::FlatList<std::uint64_t> endings_;
  base::FlatList<std::uint64_t> table_;  ///< of the endings, with open addressing; 0: unused
  unsigned shift_ = 0;                   ///< 64 minus the bits of a place in the table
  base::FlatList<Match> matches_;
  base::FlatList<std::uint64_t> passed_;
};

}  // namespace ringfence::nodes
