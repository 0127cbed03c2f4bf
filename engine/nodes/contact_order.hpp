#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// Puts contacts in the one order that files, merges and models rely on: by (a, b).
///
/// Radix sort of 64-bit keys, 11 bits a pass; digits in which all keys agree are skipped, so worlds numbered from 1 to
/// a few thousand take four passes. Memory: 32 bytes a contact, kept. Belongs to one role.
class ContactOrder {
 public:
  static constexpr std::uint64_t key(ObjectNumber a, ObjectNumber b) noexcept { return std::uint64_t{a} << 32 | b; }

  /// Forgets all keys.
  void clear() noexcept { entries_.clear(); }
  void add(ObjectNumber a, ObjectNumber b) {
    entries_.push_back({key(a, b), static_cast<std::uint32_t>(entries_.size())});
  }
  /// Sorts; afterwards at(i) is the position, in the order of add, of the i-th contact by (a, b).
  void sort();
  std::size_t size() const noexcept { return entries_.size(); }
  std::uint32_t at(std::size_t i) const noexcept { return entries_[i].index; }

 private:
  struct Entry {
    std::uint64_t key;
    std::uint32_t index;
  };
  std::vector<Entry> entries_;
  std::vector<Entry> other_;
};

}  // namespace ringfence::nodes
