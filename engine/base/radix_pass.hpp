#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

namespace ringfence::base {

/// The largest number of values that a digit of a radix pass can have.
inline constexpr std::size_t max_radix_digits = std::size_t{1} << 11;

/// One stable pass of a radix sort: writes `from` to `to`, ordered by `digit_of(entry)`, which is below `digits`.
///
/// Preconditions: `to` has room for all of `from` and does not overlap it; digits <= max_radix_digits. Uses 8 KiB of
/// stack; allocates nothing.
template <class Entry, class DigitOf>
void radix_pass(std::span<const Entry> from, Entry* to, std::size_t digits, DigitOf digit_of) {
  assert(digits <= max_radix_digits);
  std::array<std::uint32_t, max_radix_digits> next;  // where the next entry with each digit goes
  std::fill_n(next.begin(), digits, 0u);
  for (const Entry& entry : from) {
    ++next[digit_of(entry)];
  }
  std::uint32_t sum = 0;
  for (std::size_t digit = 0; digit < digits; ++digit) {
    sum += std::exchange(next[digit], sum);
  }
  for (const Entry& entry : from) {
    to[next[digit_of(entry)]++] = entry;
  }
}

}  // namespace ringfence::base
