#pragma once

#include <cstdint>
#include <type_traits>

#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence {

/// Where a contact stands in its life. Given by the server from the contacts of this frame and the one before.
enum class Phase : std::uint32_t {
  begin = 0,    ///< in contact now, not in the frame before
  persist = 1,  ///< in contact now and in the frame before
  end = 2,      ///< not in contact now, or one of the two is gone; geometry and poses are those of the last contact
};

/// Two objects whose shapes overlap or touch, with all that a response needs. One layout at the API and in messages.
///
/// A contact is a function of the two shapes and the two poses alone: the same bits at any node count, in any
/// deployment, on any machine.
struct Contact {
  ObjectNumber a = 0;  ///< the lower number
  ObjectNumber b = 0;
  Phase phase = Phase::begin;
  float depth = 0;  ///< metres, >= 0: the least translation of b along `normal` that separates the two
  Vec3f normal;     ///< unit vector from a to b
  std::uint32_t reserved = 0;
  Vec3d point;  ///< world position midway between the two surfaces at the deepest place
  Pose pose_a;  ///< as it was when the contact was determined
  Pose pose_b;
};

static_assert(sizeof(Contact) == 136 && std::is_trivially_copyable_v<Contact>);

}  // namespace ringfence
