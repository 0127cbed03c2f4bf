#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/prefetch.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::base {

/// Where the object of a number is in somebody's table: a flat hash map from object numbers to 32-bit indices.
///
/// Numbers that are not much larger than the table (most worlds count from 1) have a place of their own: four bytes,
/// one look. The others: open addressing with linear probing and backward-shift deletion (Knuth, The Art of Computer
/// Programming, 6.4 R). Allocates only when it grows past half full, or when a larger number comes that may have a
/// place; look-ups never do. Belongs to one thread at a time.
class NumberIndex {
 public:
  static constexpr std::uint32_t none = 0xffffffffu;

  explicit NumberIndex(std::size_t reserve = 0) {
    resize(reserve);
    places_.reserve(reserve + 1);
  }

  std::size_t size() const noexcept { return placed_ + size_; }

  /// The index stored for `number`, or none.
  std::uint32_t find(ObjectNumber number) const noexcept {
    if (number < places_.size()) {
      return places_[number];
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

  /// Fetches what find() will look at.
  void prefetch(ObjectNumber number) const noexcept {
    if (number < places_.size()) {
      prefetch_for_read(&places_[number]);
    } else {
      prefetch_for_read(&entries_[home(number)]);
    }
  }

  /// Stores or replaces. Precondition: number is not 0.
  void set(ObjectNumber number, std::uint32_t index) {
    if (number >= places_.size() && number < places_a_number * (size() + least_places)) {
      make_places(number);
    }
    if (number < places_.size()) {
      placed_ += places_[number] == none ? 1 : 0;
      places_[number] = index;
      return;
    }
    if ((size_ + 1) * 2 > entries_.size()) {
      resize(size_ + 1);
      return set(number, index);  // what was put in anew may have made places for more than itself
    }
    std::size_t at = home(number);
    while (entries_[at].number != 0 && entries_[at].number != number) {
      at = (at + 1) & mask_;
    }
    size_ += entries_[at].number == 0 ? 1 : 0;
    entries_[at] = {number, index};
  }

  void erase(ObjectNumber number) noexcept {
    if (number < places_.size()) {
      placed_ -= places_[number] != none ? 1 : 0;
      places_[number] = none;
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
      const std::size_t wanted = home(entries_[next].number);
      if (((next - wanted) & mask_) >= ((next - at) & mask_)) {
        entries_[at] = entries_[next];
        at = next;
      }
    }
    entries_[at].number = 0;
  }

 private:
  static constexpr std::size_t places_a_number = 16;  ///< a node's share of a world, by number, is as sparse as that
  static constexpr std::size_t least_places = 16;

  struct Entry {
    ObjectNumber number = 0;
    std::uint32_t index = 0;
  };

  std::size_t home(ObjectNumber number) const noexcept {
    return static_cast<std::size_t>((number * std::uint64_t{0x9e3779b97f4a7c15u}) >> shift_);
  }

  void resize(std::size_t objects) {
    unsigned bits = 4;
    while ((std::size_t{1} << bits) < objects * 3) {
      ++bits;
    }
    std::vector<Entry> old(std::size_t{1} << bits);
    old.swap(entries_);
    mask_ = entries_.size() - 1;
    shift_ = 64 - bits;
    size_ = 0;
    for (const Entry& entry : old) {
      if (entry.number != 0) {
        set(entry.number, entry.index);
      }
    }
  }

  // What is hashed and now has a place moves there.
  void make_places(ObjectNumber number) {
    places_.resize(std::max(number + std::size_t{1}, places_.capacity()), none);
    if (size_ == 0) {
      return;
    }
    std::vector<Entry> old(entries_.size());
    old.swap(entries_);
    size_ = 0;
    for (const Entry& entry : old) {
      if (entry.number != 0) {
        set(entry.number, entry.index);
      }
    }
  }

  std::vector<std::uint32_t> places_;  ///< by number: its index, or none
  std::size_t placed_ = 0;             ///< numbers that have one
  std::vector<Entry> entries_;
  std::size_t mask_ = 0;
  std::size_t size_ = 0;
  unsigned shift_ = 60;
};

}  // namespace ringfence::base
