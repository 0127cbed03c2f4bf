#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "base/numbers.hpp"

namespace ringfence::nodes {

/// Which CD nodes have listed something for one node to read in place: one bit a slot. So a node reads the lists of the
/// few nodes that have something for it, and not those of a thousand.
///
/// A bit is a hint: it may remain from an earlier frame, or be that of a node that is lost. The list itself says which
/// frame it is for.
///
/// Threads: any node adds itself, after it has made what the receiver shall find. Only the receiver takes; it then sees
/// what was made before.
class SenderSet {
 public:
  static constexpr NodeNumber capacity = 1024;  ///< slots are below this number

  void add(NodeNumber sender) noexcept {
    // Pairs with the exchange in take().
    words_[sender / 64].fetch_or(std::uint64_t{1} << sender % 64, std::memory_order_release);
  }
  /// Removes all senders and calls visit(sender) for each, by ascending slot.
  template <class Visit>
  void take(Visit visit) {
    for (std::size_t word = 0; word < words_.size(); ++word) {
      if (words_[word].load(std::memory_order_relaxed) == 0) {
        continue;
      }
      for (std::uint64_t bits = words_[word].exchange(0, std::memory_order_acquire); bits != 0; bits &= bits - 1) {
        visit(static_cast<NodeNumber>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits))));
      }
    }
  }

 private:
  std::array<std::atomic<std::uint64_t>, capacity / 64> words_{};
};

}  // namespace ringfence::nodes
