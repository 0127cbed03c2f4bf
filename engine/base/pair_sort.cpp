#include "base/pair_sort.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "base/radix_pass.hpp"

namespace ringfence::base {
namespace {

constexpr unsigned max_digit_bits = 11;
static_assert(std::size_t{1} << max_digit_bits == max_radix_digits);
constexpr std::size_t max_comparison_sort = 64;  // up to this size, comparisons are cheaper than clearing one histogram

/// Sorts nearly sorted entries by insertion. Gives up and returns false after 4 moves an entry.
bool insertion_sort(FlatList<std::uint64_t>& entries) noexcept {
  std::size_t moves = 4 * entries.size();
  for (std::size_t i = 1; i < entries.size(); ++i) {
    const std::uint64_t entry = entries[i];
    std::size_t at = i;
    for (; at > 0 && entries[at - 1] > entry && moves > 0; --at, --moves) {
      entries[at] = entries[at - 1];
    }
    entries[at] = entry;
  }
  return moves > 0;
}

}  // namespace

void PairSort::sort() {
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

void PairSort::sort_narrow(unsigned a_bits, unsigned b_bits) {
  const std::uint64_t a_mask = (std::uint64_t{1} << a_bits) - 1;
  const std::uint64_t b_mask = (std::uint64_t{1} << b_bits) - 1;
  entries_.resize(keys_.size());
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    const std::uint64_t bits = (keys_[i] >> 32 & a_mask) << b_bits | (keys_[i] & b_mask);
    entries_[i] = bits << index_bits_ | i;
  }
  if (entries_.size() <= max_comparison_sort) {
    std::sort(entries_.begin(), entries_.end());
    return;
  }
  // Sorts by enough upper bits to make most entries differ, then by insertion. If that takes too long, because a few
  // numbers have most of the contacts, sorts by all bits.
  const auto needed = std::min(a_bits + b_bits, static_cast<unsigned>(std::bit_width(entries_.size())) + 2);
  sort_narrow_by(index_bits_ + a_bits + b_bits - needed, index_bits_ + a_bits + b_bits);
  if (!insertion_sort(entries_)) {
    sort_narrow_by(index_bits_, index_bits_ + a_bits + b_bits);
  }
}

// Sorts by the given bits, in the least number of passes, with equal digits.
void PairSort::sort_narrow_by(unsigned first_bit, unsigned end_bit) {
  other_.resize(entries_.size());
  const unsigned passes = (end_bit - first_bit + max_digit_bits - 1) / max_digit_bits;
  const unsigned bits = passes == 0 ? 0 : (end_bit - first_bit + passes - 1) / passes;
  const std::uint64_t mask = (std::uint64_t{1} << bits) - 1;
  for (unsigned shift = first_bit; shift < end_bit; shift += bits) {
    radix_pass(entries_.span(), other_.data(), mask + 1,
               [shift, mask](std::uint64_t entry) { return entry >> shift & mask; });
    std::swap(entries_, other_);
  }
}

void PairSort::sort_wide(std::uint64_t differs) {
  wide_entries_.resize(keys_.size());
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    wide_entries_[i] = {keys_[i], i};
  }
  if (wide_entries_.size() <= max_comparison_sort) {
    std::sort(wide_entries_.begin(), wide_entries_.end(),
              [](const WideEntry& p, const WideEntry& q) { return p.key < q.key; });
    return;
  }
  wide_other_.resize(keys_.size());
  constexpr std::size_t digits = std::size_t{1} << max_digit_bits;
  for (unsigned shift = 0; shift < 64; shift += max_digit_bits) {
    if ((differs >> shift & (digits - 1)) == 0) {
      continue;
    }
    radix_pass(wide_entries_.span(), wide_other_.data(), digits,
               [shift](const WideEntry& entry) { return entry.key >> shift & (digits - 1); });
    std::swap(wide_entries_, wide_other_);
  }
}

}  // namespace ringfence::base
