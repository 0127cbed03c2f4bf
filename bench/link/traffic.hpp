#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace ringfence::bench {

/// The messages of a burst, and the sum of all their words.
///
/// Every message is copied from a source that stays in the L1 cache; its first word is its number. The consumer adds up
/// all words. So each byte is written once and read once, as in production.
struct Traffic {
  std::size_t count;     ///< number of messages in a burst
  std::size_t smallest;  ///< smallest size in bytes, a multiple of 8
  std::size_t largest;   ///< largest size; if it differs from `smallest`, sizes vary
  std::size_t items;     ///< records in a message, for the reported rate

  std::size_t size_of(std::size_t message) const {
    if (smallest == largest) return smallest;
    // A fixed pseudo-random order of sizes, without division, too long for a branch predictor.
    const std::uint64_t hash = (message & 1023) * 0x9e3779b97f4a7c15u >> 40;
    return smallest + (hash * ((largest - smallest) / 8 + 1) >> 24) * 8;
  }
  std::size_t bytes() const {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += size_of(i);
    return sum;
  }
};

using Block = std::array<std::uint64_t, 512>;  ///< 4 KiB

inline const Block& source() {
  alignas(64) static const Block block = [] {
    Block words{};
    for (std::size_t i = 0; i < words.size(); ++i) words[i] = i * 0x9e3779b97f4a7c15u;
    return words;
  }();
  return block;
}

inline void fill(void* to, std::size_t size, std::uint64_t number) {
  if (size > 8) std::memcpy(to, source().data(), size);
  std::memcpy(to, &number, 8);
}

[[gnu::always_inline]] inline std::uint64_t add_up(const std::byte* words, std::size_t size) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < size; i += 8) {
    std::uint64_t word;
    std::memcpy(&word, words + i, 8);
    sum += word;
  }
  return sum;
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] inline std::uint64_t add_up_avx2(const std::byte* words, std::size_t size) {
  return add_up(words, size);
}
[[gnu::target("avx512f")]] inline std::uint64_t add_up_avx512(const std::byte* words, std::size_t size) {
  return add_up(words, size);
}
#endif

/// Uses the widest vectors of the machine for messages of at least 256 bytes, so that the sum does not hide the cost of
/// the queue.
inline std::uint64_t sum_of(const void* from, std::size_t size) {
  const auto* words = static_cast<const std::byte*>(from);
#if defined(__x86_64__)
  if (size < 256) return add_up(words, size);
  static const bool has_avx2 = __builtin_cpu_supports("avx2"), has_avx512 = __builtin_cpu_supports("avx512f");
  if (has_avx512) return add_up_avx512(words, size);
  if (has_avx2) return add_up_avx2(words, size);
#endif
  return add_up(words, size);
}

inline std::uint64_t expected_sum(const Traffic& traffic) {
  std::array<std::uint64_t, 513> prefix{};
  for (std::size_t i = 0; i < 512; ++i) prefix[i + 1] = prefix[i] + (i == 0 ? 0 : source()[i]);
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < traffic.count; ++i) sum += prefix[traffic.size_of(i) / 8] + i;
  return sum;
}

}  // namespace ringfence::bench
