#pragma once

#include <compare>
#include <cstdint>

namespace ringfence {

/// Number of an object in scenes, files, digests and contacts: 1 to 2^32 - 1, unique among live objects.
///
/// It orders every pair (a < b) and keys the object's random stream.
using ObjectNumber = std::uint32_t;

/// Handle of a live object: its number and the generation of its spawn. The value 0 is null.
///
/// Every spawn has its own generation, so the handle of a destroyed object is refused as stale even if its number is in
/// use again. Generations wrap around after 2^32 - 1 spawns.
struct ObjectId {
  std::uint64_t value = 0;

  static constexpr ObjectId of(ObjectNumber number, std::uint32_t generation) noexcept {
    return {std::uint64_t{generation} << 32 | number};
  }
  constexpr ObjectNumber number() const noexcept { return static_cast<ObjectNumber>(value); }
  constexpr std::uint32_t generation() const noexcept { return static_cast<std::uint32_t>(value >> 32); }
  constexpr explicit operator bool() const noexcept { return value != 0; }
  constexpr auto operator<=>(const ObjectId&) const noexcept = default;
};

/// Number of a user node, chosen by the caller that connects it: 0 to Limits::users - 1.
using UserNumber = std::uint32_t;
/// No user node.
inline constexpr UserNumber no_user = 0xffffffffu;

/// Number of a CD node: 0 to nodes - 1.
using NodeNumber = std::uint32_t;

/// Number of a registered shape: the order of registration, from 0.
using ShapeNumber = std::uint32_t;

}  // namespace ringfence
