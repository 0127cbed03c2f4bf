#pragma once

#include <cstddef>
#include <cstdint>

#include "base/flat_list.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::base {

/// Puts contacts in the one order that files, merges and models rely on: by (a, b).
///
/// Radix sort, at most 11 bits a pass, of as many bits of the two numbers as differ; of as many of these as there are
/// contacts to tell apart, where that leaves little to be put right by insertion. Where the bits and a contact's
/// position fit 64 bits, as in every world that is numbered from 1 up to millions of objects, eight bytes are sorted,
/// else sixteen. Memory: 40 bytes a contact at most, kept. Belongs to one role.
class PairSort {
 public:
  static constexpr std::uint64_t key(ObjectNumber a, ObjectNumber b) noexcept { return std::uint64_t{a} << 32 | b; }

  /// For so many keys; more are taken at the price of allocations.
  void reserve(std::size_t keys) {
    keys_.reserve(keys);
    entries_.reserve(keys);
    other_.reserve(keys);
  }
  /// Forgets all keys.
  void clear() noexcept { keys_.clear(); }
  void add(ObjectNumber a, ObjectNumber b) { keys_.push_back(key(a, b)); }
  void add(std::uint64_t key) { keys_.push_back(key); }
  /// Sorts; afterwards at(i) is the position, in the order of add, of the i-th contact by (a, b), and key_at(i) its
  /// key.
  void sort();
  /// The i-th key that was added.
  std::uint64_t added(std::size_t i) const noexcept { return keys_[i]; }
  std::size_t size() const noexcept { return keys_.size(); }
  std::uint32_t at(std::size_t i) const noexcept {
    return static_cast<std::uint32_t>(wide_ ? wide_entries_[i].index
                                            : entries_[i] & ((std::uint64_t{1} << index_bits_) - 1));
  }
  std::uint64_t key_at(std::size_t i) const noexcept { return keys_[at(i)]; }

 private:
  struct WideEntry {
    std::uint64_t key;
    std::uint64_t index;
  };

  void sort_narrow(unsigned a_bits, unsigned b_bits);
  void sort_narrow_by(unsigned first_bit, unsigned end_bit);
  void sort_wide(std::uint64_t differs);

  FlatList<std::uint64_t> keys_;  ///< in the order of add
  bool wide_ = false;
  unsigned index_bits_ = 0;
  FlatList<std::uint64_t> entries_, other_;  ///< bits of a, bits of b, position
  FlatList<WideEntry> wide_entries_, wide_other_;
};

}  // namespace ringfence::base
