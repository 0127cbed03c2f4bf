#pragma once

#include <cstddef>
#include <cstdint>

#include "base/flat_list.hpp"
#include "base/prefetch.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::base {

/// Sorts pairs of object numbers, the keys of contacts, by (a, b): the order of files, merges and models.
///
/// Radix sort with at most 11 bits a pass. Uses only the bits in which the numbers differ. If few pairs are equal in
/// their upper bits, it sorts by these bits only and finishes by insertion. If the bits and a pair's position fit into
/// 64 bits, as in every world with numbers from 1 to some millions, an entry has 8 bytes, else 16. Memory: at most 40
/// bytes a pair, kept. Belongs to one role.
class PairSort {
 public:
  static constexpr std::uint64_t key(ObjectNumber a, ObjectNumber b) noexcept { return std::uint64_t{a} << 32 | b; }

  /// Reserves memory for `keys` pairs. More may be added, at the cost of an allocation.
  void reserve(std::size_t keys) {
    keys_.reserve(keys);
    entries_.reserve(keys);
    other_.reserve(keys);
  }
  /// The same where there are usually much fewer: only what is used occupies memory.
  void reserve_rarely_used(std::size_t keys) {
    keys_.reserve_rarely_used(keys);
    entries_.reserve_rarely_used(keys);
    other_.reserve_rarely_used(keys);
  }
  /// Removes all keys.
  void clear() noexcept { keys_.clear(); }
  void add(ObjectNumber a, ObjectNumber b) { keys_.push_back(key(a, b)); }
  void add(std::uint64_t key) { keys_.push_back(key); }
  /// Sorts. Afterwards, at(i) is the position of the i-th smallest key in the order of adding, and key_at(i) is that
  /// key.
  void sort();
  /// The i-th key in the order of adding.
  std::uint64_t added(std::size_t i) const noexcept { return keys_[i]; }
  /// Prefetches what added() reads.
  void prefetch_added(std::size_t i) const noexcept { prefetch_for_read(&keys_[i]); }
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

  FlatList<std::uint64_t> keys_;  ///< in the order of adding
  bool wide_ = false;
  unsigned index_bits_ = 0;
  FlatList<std::uint64_t> entries_, other_;  ///< bits of a, bits of b, position
  FlatList<WideEntry> wide_entries_, wide_other_;
};

}  // namespace ringfence::base
