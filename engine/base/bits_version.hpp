#pragma once

#include <cstdint>

namespace ringfence::base {

/// Increased with every change after which two builds of one version may find contacts that differ in a bit.
inline constexpr std::uint32_t bits_version = 1;

}  // namespace ringfence::base
