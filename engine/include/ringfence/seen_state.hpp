#pragma once

#include <cstdint>
#include <type_traits>

#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence {

/// State of an object as user nodes see it. Published once a frame by the object's host, or by the server on its
/// behalf, and read in place by every user node near it.
struct SeenState {
  ObjectNumber number = 0;
  std::uint32_t flags = 0;  ///< reserved, 0
  Pose pose;
  constexpr bool operator==(const SeenState&) const noexcept = default;
};
static_assert(sizeof(SeenState) == 48 && std::is_trivially_copyable_v<SeenState>);

}  // namespace ringfence
