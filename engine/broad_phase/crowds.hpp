#pragma once

#include <cstdint>

namespace ringfence::broad_phase {

/// A crowd is a number other than 0 that objects share, here the avatars of one
/// user who has more than may collide with each other. Two objects of one crowd
/// are no pair if either has the excess bit. All other pairs stand.
inline constexpr std::uint32_t excess_bit = 0x80000000;

/// Whether the crowds of two objects allow a pair.
constexpr bool crowds_collide(std::uint32_t p, std::uint32_t q) noexcept {
  return ((p ^ q) & ~excess_bit) != 0 || p == 0 || ((p | q) & excess_bit) == 0;
}

}  // namespace ringfence::broad_phase
