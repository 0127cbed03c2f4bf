#include "nodes/contact_order.hpp"

#include <algorithm>
#include <array>

namespace ringfence::nodes {

void ContactOrder::sort() {
  constexpr unsigned bits = 11;
  constexpr std::size_t radix = std::size_t{1} << bits;
  constexpr std::size_t few = 64;  // below this, comparing is cheaper than clearing one histogram
  if (entries_.size() <= few) {
    std::sort(entries_.begin(), entries_.end(), [](const Entry& p, const Entry& q) { return p.key < q.key; });
    return;
  }
  std::uint64_t any = 0;
  std::uint64_t all = ~std::uint64_t{0};
  for (const Entry& entry : entries_) {
    any |= entry.key;
    all &= entry.key;
  }
  const std::uint64_t differs = any ^ all;
  other_.resize(entries_.size());
  std::array<std::uint32_t, radix> begin;
  for (unsigned shift = 0; shift < 64; shift += bits) {
    if ((differs >> shift & (radix - 1)) == 0) {
      continue;
    }
    begin.fill(0);
    for (const Entry& entry : entries_) {
      ++begin[entry.key >> shift & (radix - 1)];
    }
    std::uint32_t sum = 0;
    for (std::uint32_t& slot : begin) {
      const std::uint32_t count = slot;
      slot = sum;
      sum += count;
    }
    for (const Entry& entry : entries_) {
      other_[begin[entry.key >> shift & (radix - 1)]++] = entry;
    }
    entries_.swap(other_);
  }
}

}  // namespace ringfence::nodes
