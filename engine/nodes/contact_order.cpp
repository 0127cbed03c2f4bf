#include "nodes/contact_order.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

namespace ringfence::nodes {
namespace {

constexpr unsigned digit_bits = 11;
constexpr std::size_t digits = std::size_t{1} << digit_bits;
constexpr std::size_t few = 64;  // below this, comparing is cheaper than clearing one histogram

/// One stable pass from `from` to `to` by the digit that `digit_of` names.
template <class Entry, class Digit>
void scatter(const FlatList<Entry>& from, FlatList<Entry>& to, Digit digit_of) {
  std::array<std::uint32_t, digits> begin{};
  for (const Entry& entry : from) {
    ++begin[digit_of(entry)];
  }
  std::uint32_t sum = 0;
  for (std::uint32_t& place : begin) {
    sum += std::exchange(place, sum);
  }
  for (const Entry& entry : from) {
    to[begin[digit_of(entry)]++] = entry;
  }
}

}  // namespace

void ContactOrder::sort() {
  std::uint64_t any = 0;
  std::uint64_t all = ~std::uint64_t{0};
  for (const std::uint64_t key : keys_) {
    any |= key;
    all &= key;
  }
  const std::uint64_t differs = keys_.empty() ? 0 : any ^ all;
  const auto a_bits = static_cast<unsigned>(std::bit_width(differs >> 32));
  const auto b_bits = static_cast<unsigned>(std::bit_width(differs & 0xffffffffu));
  index_bits_ = static_cast<unsigned>(std::bit_width(keys_.size()));
  wide_ = a_bits + b_bits + index_bits_ > 64;
  if (wide_) {
    sort_wide(differs);
  } else {
    sort_narrow(a_bits, b_bits);
  }
}

void ContactOrder::sort_narrow(unsigned a_bits, unsigned b_bits) {
  const std::uint64_t a_mask = (std::uint64_t{1} << a_bits) - 1;
  const std::uint64_t b_mask = (std::uint64_t{1} << b_bits) - 1;
  entries_.resize(keys_.size());
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    const std::uint64_t bits = (keys_[i] >> 32 & a_mask) << b_bits | (keys_[i] & b_mask);
    entries_[i] = bits << index_bits_ | i;
  }
  if (entries_.size() <= few) {
    std::sort(entries_.begin(), entries_.end());
    return;
  }
  other_.resize(entries_.size());
  for (unsigned shift = index_bits_; shift < index_bits_ + a_bits + b_bits; shift += digit_bits) {
    scatter(entries_, other_, [shift](std::uint64_t entry) { return entry >> shift & (digits - 1); });
    std::swap(entries_, other_);
  }
}

void ContactOrder::sort_wide(std::uint64_t differs) {
  wide_entries_.resize(keys_.size());
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    wide_entries_[i] = {keys_[i], i};
  }
  if (wide_entries_.size() <= few) {
    std::sort(wide_entries_.begin(), wide_entries_.end(),
              [](const WideEntry& p, const WideEntry& q) { return p.key < q.key; });
    return;
  }
  wide_other_.resize(keys_.size());
  for (unsigned shift = 0; shift < 64; shift += digit_bits) {
    if ((differs >> shift & (digits - 1)) == 0) {
      continue;
    }
    scatter(wide_entries_, wide_other_, [shift](const WideEntry& entry) { return entry.key >> shift & (digits - 1); });
    std::swap(wide_entries_, wide_other_);
  }
}

}  // namespace ringfence::nodes
