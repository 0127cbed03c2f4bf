#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include "ringfence/contact.hpp"

namespace ringfence {

/// Digest of a run. Runs whose frames have the same begin and persist contacts, bit for bit, have the same digest;
/// different contacts give different digests except for hash collisions.
///
/// The digest of a frame is the sum (mod 2^64) of the hashes of its contacts (numbers, normal, depth, point; neither
/// phase nor poses), so their order does not matter. The digest of the run folds those of the frames in order.
class Digest {
 public:
  Digest() noexcept = default;
  /// Continues the digest of a run whose value so far is known, such as from a save.
  explicit Digest(std::uint64_t value) noexcept : value_(value) {}
  /// Adds the next frame.
  void add_frame(std::span<const Contact> contacts) noexcept {
    std::uint64_t sum = 0;
    for (const Contact& contact : contacts) {
      sum += hash(contact);
    }
    value_ = mix(value_ ^ mix(sum + 0x9e3779b97f4a7c15u));
  }
  std::uint64_t value() const noexcept { return value_; }

  static std::uint64_t hash(const Contact& contact) noexcept {
    std::uint64_t h = mix(std::uint64_t{contact.a} << 32 | contact.b);
    h = mix(h ^ (std::uint64_t{bits(contact.normal.x)} << 32 | bits(contact.normal.y)));
    h = mix(h ^ (std::uint64_t{bits(contact.normal.z)} << 32 | bits(contact.depth)));
    h = mix(h ^ std::bit_cast<std::uint64_t>(contact.point.x));
    h = mix(h ^ std::bit_cast<std::uint64_t>(contact.point.y));
    return mix(h ^ std::bit_cast<std::uint64_t>(contact.point.z));
  }

 private:
  static std::uint32_t bits(float value) noexcept { return std::bit_cast<std::uint32_t>(value); }
  // The finaliser of splitmix64 (Steele, Lea, Flood 2014).
  static constexpr std::uint64_t mix(std::uint64_t x) noexcept {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
  }

  std::uint64_t value_ = 0;
};

}  // namespace ringfence
