#pragma once

#include <cstdint>

#include "base/numbers.hpp"
#include "messages/records.hpp"
#include "ringfence/object.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::nodes {

/// Data of an object that the server reads each frame: one cache line.
struct alignas(64) ObjectRow {
  messages::ObjectRef object;  ///< flags: flag_present
  Pose pose;
  ShapeNumber shape = 0;
  std::uint16_t layer = 0;
  std::uint16_t category = 0;
};
static_assert(sizeof(ObjectRow) == 64);

/// Data of an object that is read only when its host changes or on request. Without padding.
struct alignas(4) [[gnu::packed]] ObjectOrigin {
  std::uint64_t user_data = 0;
  UserNumber user = no_user_number;  ///< owner of an avatar
};
static_assert(sizeof(ObjectOrigin) == 12);

}  // namespace ringfence::nodes
