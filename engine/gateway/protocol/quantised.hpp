#pragma once

#include <array>
#include <cstdint>

#include "ringfence/pose.hpp"

namespace ringfence::gateway {

/// Metres in a quantum, the unit of positions in messages.
inline constexpr double quantum = 0x1p-9;

/// A position in quanta.
struct QuantisedPosition {
  std::int64_t x = 0, y = 0, z = 0;
  constexpr bool operator==(const QuantisedPosition&) const noexcept = default;
};

/// The nearest position in quanta; beyond 2^62 quanta, 2^62. Precondition: finite.
QuantisedPosition quantise(const Vec3d& position) noexcept;
/// In metres.
Vec3d position_of(const QuantisedPosition& position) noexcept;

/// An orientation as a `turn`: the three components with the lower magnitudes in 10 bits each. Precondition: close to
/// unit length.
std::uint32_t quantise(const Quat& orientation) noexcept;
/// The orientation of a `turn`; unit length but for rounding. Every value of `turn` is one.
Quat orientation_of(std::uint32_t turn) noexcept;

/// A direction with three signed bytes; 1/127 each.
struct QuantisedNormal {
  std::int8_t x = 0, y = 0, z = 0;
  constexpr bool operator==(const QuantisedNormal&) const noexcept = default;
};
QuantisedNormal quantise_normal(const Vec3f& normal) noexcept;
Vec3f normal_of(const QuantisedNormal& normal) noexcept;

}  // namespace ringfence::gateway
