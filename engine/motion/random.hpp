#pragma once

#include <array>
#include <cstdint>

namespace ringfence::motion {

/// Philox4x32-10: a counter-based generator (Salmon, Moraes, Dror, Shaw 2011). Four random words are a pure function of
/// a counter and a key, so any thread finds any draw without shared state, in any order, with the same bits.
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

/// Uniform in [0, 1), a multiple of 2^-24: exact in float.
constexpr float uniform(std::uint32_t word) noexcept { return static_cast<float>(word >> 8) * 0x1p-24f; }

/// Uniform in [0, count) to within 2^-32 of each share. Precondition: count > 0.
constexpr std::uint32_t uniform_below(std::uint32_t count, std::uint32_t word) noexcept {
  return static_cast<std::uint32_t>((std::uint64_t{word} * count) >> 32);
}

/// A row of draws for one subject: counter-based, but read one word after the other. Cheap to make; not shared.
class Draws {
 public:
  /// `stream` tells purposes apart, `subject` is an object, target or shape, `epoch` counts its turns (below 2^32).
  constexpr Draws(std::uint64_t seed, std::uint32_t stream, std::uint32_t subject, std::uint32_t epoch = 0) noexcept
      : seed_(seed), counter_{subject, epoch, 0, stream} {}

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
