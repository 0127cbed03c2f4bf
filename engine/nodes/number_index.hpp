#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// Where the object of a number is in somebody's table: a flat hash map from object numbers to 32-bit indices.
///
/// Open addressing with linear probing and backward-shift deletion (Knuth, The Art of Computer Programming, 6.4 R).
/// Allocates only when it grows past half full; look-ups never do. Belongs to one thread at a time.
class NumberIndex {
 public:
  static constexpr std::uint32_t none = 0xffffffffu;

  explicit NumberIndex(std::size_t reserve = 0) { resize(reserve); }

  std::size_t size() const noexcept { return size_; }

  /// The index stored for `number`, or none.
  std::uint32_t find(ObjectNumber number) const noexcept {
    for (std::size_t at = home(number);; at = (at + 1) & mask_) {
      if (entries_[at].number == number) {
        return entries_[at].index;
      }
      if (entries_[at].number == 0) {
        return none;
      }
    }
  }

  /// Stores or replaces. Precondition: number is not 0.
  void set(ObjectNumber number, std::uint32_t index) {
    if ((size_ + 1) * 2 > entries_.size()) {
      resize(size_ + 1);
    }
    std::size_t at = home(number);
    while (entries_[at].number != 0 && entries_[at].number != number) {
      at = (at + 1) & mask_;
    }
    size_ += entries_[at].number == 0 ? 1 : 0;
    entries_[at] = {number, index};
  }

  void erase(ObjectNumber number) noexcept {
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

  std::vector<Entry> entries_;
  std::size_t mask_ = 0;
  std::size_t size_ = 0;
  unsigned shift_ = 60;
};

}  // namespace ringfence::nodes
