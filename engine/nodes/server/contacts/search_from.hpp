#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace ringfence::nodes {

/// Exponential search for the first of ascending keys that is not below `key`; fast if it is near `first`.
inline const std::uint64_t* search_from(const std::uint64_t* first, const std::uint64_t* end,
                                        std::uint64_t key) noexcept {
  std::ptrdiff_t stride = 1;
  while (stride < end - first && first[stride] < key) {
    first += stride;
    stride *= 2;
  }
  return std::lower_bound(first, first + std::min(stride + 1, end - first), key);
}

}  // namespace ringfence::nodes
