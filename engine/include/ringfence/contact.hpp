#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence {

/// Phase of a contact, computed from the contacts of this frame and of the frame before.
enum class Phase : std::uint32_t {
  begin = 0,    ///< in contact now, not in the frame before
  persist = 1,  ///< in contact now and in the frame before
  /// No longer in contact, or one of the two objects is gone; geometry and poses are those of the last contact.
  end = 2,
};
/// "begin", "persist", "end".
constexpr const char* name_of(Phase phase) noexcept {
  constexpr const char* names[] = {"begin", "persist", "end"};
  return names[static_cast<std::size_t>(phase)];
}

/// Two objects whose shapes overlap or touch, with what a collision response needs. The same layout in the API and in
/// messages.
///
/// The geometry of a contact is a function of the two shapes and the two poses: the same bits at any node count, in any
/// deployment, on any machine.
struct Contact {
  ObjectNumber a = 0;  ///< the lower of the two numbers
  ObjectNumber b = 0;
  Phase phase = Phase::begin;
  float depth = 0;  ///< metres, >= 0: the least translation of b along `normal` that separates the two
  Vec3f normal;     ///< unit vector from a to b
  std::uint32_t reserved = 0;
  Vec3d point;  ///< world position midway between the two surfaces at the deepest place, metres
  Pose pose_a;  ///< pose of a when the pair was tested
  Pose pose_b;
};

static_assert(sizeof(Contact) == 136 && std::is_trivially_copyable_v<Contact>);

}  // namespace ringfence
