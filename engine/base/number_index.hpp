#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/prefetch.hpp"
#include "base/zeroed_array.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::base {

/// A map from object numbers to 32-bit indices, for tables that are searched by object number.
///
/// A number that is small compared with the number of entries (most worlds number their objects from 1) has an entry of
/// 4 bytes in an array, so its look-up is one read. Other numbers are in a hash table with open addressing, linear
/// probing and backward-shift deletion (Knuth, The Art of Computer Programming, section 6.4, algorithm R).
///
/// Number 0 is not allowed, because it marks empty entries; for 0, find() returns an unspecified index.
///
/// Threads: belongs to one thread at a time. Memory: after construction only set() allocates, when the hash table would
/// become more than half full, or when a larger number gets an entry in the array. The constructor and set() throw
/// std::bad_alloc.
class NumberIndex {
 public:
  static constexpr std::uint32_t none = 0xffffffffu;

  /// Reserves `reserve` entries in the array and in the hash table. As long as all numbers have entries in the array,
  /// the hash table occupies no memory.
  explicit NumberIndex(std::size_t reserve = 0) {
    resize(reserve);
    direct_.reserve(reserve + 1);
  }

  /// Number of stored numbers.
  std::size_t size() const noexcept { return direct_count_ + size_; }

  /// The index stored for `number`, or `none`.
  std::uint32_t find(ObjectNumber number) const noexcept {
    if (number < direct_.size()) {
      return direct_[number];
    }
    for (std::size_t at = home(number);; at = (at + 1) & mask_) {
      if (entries_[at].number == number) {
        return entries_[at].index;
      }
      if (entries_[at].number == 0) {
        return none;
      }
    }
  }

  /// Prefetches the entry that find() reads first.
  void prefetch(ObjectNumber number) const noexcept {
    if (number < direct_.size()) {
      prefetch_for_read(&direct_[number]);
    } else {
      prefetch_for_read(&entries_[home(number)]);
    }
  }

  /// Stores or replaces the index of `number`. Precondition: number is not 0.
  void set(ObjectNumber number, std::uint32_t index) {
    if (number >= direct_.size()) {
      grow_direct(number);
    }
    if (number < direct_.size()) {
      direct_count_ += direct_[number] == none ? 1 : 0;
      direct_[number] = index;
      return;
    }
    if ((size_ + 1) * 2 > entries_.size()) {
      resize(size_ + 1);
      return set(number, index);  // resize() may have moved numbers to the array
    }
    std::size_t at = home(number);
    while (entries_[at].number != 0 && entries_[at].number != number) {
      at = (at + 1) & mask_;
    }
    size_ += entries_[at].number == 0 ? 1 : 0;
    entries_[at] = {number, index};
  }

  /// Removes `number`; does nothing if it is not stored. Precondition: number is not 0.
  void erase(ObjectNumber number) noexcept {
    if (number < direct_.size()) {
      direct_count_ -= direct_[number] != none ? 1 : 0;
      direct_[number] = none;
      return;
    }
    std::size_t at = home(number);
    while (entries_[at].number != number) {
      if (entries_[at].number == 0) {
        return;
      }
      at = (at + 1) & mask_;
    }
    --size_;
    for (std::size_t next = (at + 1) & mask_; entries_[next].number != 0; next = (next + 1) & mask_) {
      const std::size_t home_of_next = home(entries_[next].number);
      if (((next - home_of_next) & mask_) >= ((next - at) & mask_)) {
        entries_[at] = entries_[next];
        at = next;
      }
    }
    entries_[at].number = 0;
  }

 private:
  /// The array is extended up to a number that is less than this many times the number of entries. With 16 CD nodes, a
  /// node stores about 1 in 16 of the world's numbers, and an array that is not extended yet covers 16 times its
  /// entries.
  static constexpr std::size_t max_numbers_per_entry = 18;
  /// It is extended by at least an eighth, since all numbers of the hash table are then stored again.
  static constexpr std::size_t growth_divisor = 8;
  /// Added to the number of entries in that comparison, so that small tables use the array, too.
  static constexpr std::size_t min_entries = 16;

  struct Entry {
    ObjectNumber number;  ///< 0: unused
    std::uint32_t index;
  };

  std::size_t home(ObjectNumber number) const noexcept {
    return static_cast<std::size_t>((number * std::uint64_t{0x9e3779b97f4a7c15u}) >> shift_);
  }

  void resize(std::size_t objects) {
    unsigned bits = 4;
    while ((std::size_t{1} << bits) < objects * 3) {
      ++bits;
    }
    const ZeroedArray<Entry> old = std::exchange(entries_, ZeroedArray<Entry>(std::size_t{1} << bits));
    mask_ = entries_.size() - 1;
    shift_ = 64 - bits;
    size_ = 0;
    for (const Entry& entry : old) {
      if (entry.number != 0) {
        set(entry.number, entry.index);
      }
    }
  }

  // Extends the array beyond `number`, which has no entry in it, if that number is small enough. Moves the numbers that
  // now have an entry there out of the hash table.
  void grow_direct(ObjectNumber number) {
    const std::size_t limit = max_numbers_per_entry * (size() + min_entries);
    if (number >= limit || limit < direct_.size() + direct_.size() / growth_divisor) {
      return;
    }
    direct_.resize(std::max({number + std::size_t{1}, direct_.capacity(), std::min(limit, 2 * direct_.size())}), none);
    if (size_ == 0) {
      return;
    }
    const ZeroedArray<Entry> old = std::exchange(entries_, ZeroedArray<Entry>(entries_.size()));
    size_ = 0;
    for (const Entry& entry : old) {
      if (entry.number != 0) {
        set(entry.number, entry.index);
      }
    }
  }

  std::vector<std::uint32_t> direct_;  ///< by number: its index, or `none`
  std::size_t direct_count_ = 0;       ///< number of used entries in direct_
  ZeroedArray<Entry> entries_;         ///< the hash table
  std::size_t mask_ = 0;
  std::size_t size_ = 0;  ///< number of used entries in entries_
  unsigned shift_ = 60;
};

}  // namespace ringfence::base
