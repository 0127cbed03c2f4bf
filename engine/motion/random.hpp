#pragma once

#include <array>
#include <cstdint>

namespace ringfence::motion {

/// Philox4x32-10, a counter-based generator (Salmon, Moraes, Dror, Shaw 2011): a pure function of a counter and a key
/// that returns four random words. So any thread can compute any draw, in any order, with the same bits and without
/// shared state.
constexpr std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::uint64_t key) noexcept {
  auto low = static_cast<std::uint32_t>(key);
  auto high = static_cast<std::uint32_t>(key >> 32);
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t p = std::uint64_t{0xD2511F53u} * counter[0];
    const std::uint64_t q = std::uint64_t{0xCD9E8D57u} * counter[2];
    counter = {static_cast<std::uint32_t>(q >> 32) ^ counter[1] ^ low, static_cast<std::uint32_t>(q),
               static_cast<std::uint32_t>(p >> 32) ^ counter[3] ^ high, static_cast<std::uint32_t>(p)};
    low += 0x9E3779B9u;
    high += 0xBB67AE85u;
  }
  return counter;
}

/// A float uniform in [0, 1): a multiple of 2^-24, so the value is exact.
constexpr float uniform(std::uint32_t word) noexcept { return static_cast<float>(word >> 8) * 0x1p-24f; }

/// An integer uniform in [0, count); each probability is 1 / count to within 2^-32. Precondition: count > 0.
constexpr std::uint32_t uniform_below(std::uint32_t count, std::uint32_t word) noexcept {
  return static_cast<std::uint32_t>((std::uint64_t{word} * count) >> 32);
}

/// A sequence of random draws for one decision of one subject. Cheap to construct; belongs to one thread.
class Draws {
 public:
  /// `stream` separates purposes, `subject` is the number of an object, target or shape, and `epoch` is the number of
  /// its decision (no relation to the epoch of a region map).
  constexpr Draws(std::uint64_t seed, std::uint32_t stream, std::uint32_t subject, std::uint32_t epoch = 0) noexcept
      : seed_(seed), counter_{subject, epoch, 0, stream} {}

  /// The next 32 random bits.
  constexpr std::uint32_t word() noexcept {
    if (used_ == 4) {
      block_ = philox(counter_, seed_);
      ++counter_[2];
      used_ = 0;
    }
    return block_[used_++];
  }
  /// Uniform in [0, 1).
  constexpr float unit() noexcept { return uniform(word()); }
  /// Uniform in [low, high), up to rounding.
  constexpr float between(float low, float high) noexcept { return low + (high - low) * unit(); }

 private:
  std::uint64_t seed_;
  std::array<std::uint32_t, 4> counter_;
  std::array<std::uint32_t, 4> block_{};
  std::uint32_t used_ = 4;
};

}  // namespace ringfence::motion
