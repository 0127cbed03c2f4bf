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
  /// No longer in contact, or one of the two objects is gone; all other fields are those of the last contact.
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
/// deployment, on any machine. All fields are those of the frame in which the pair was tested.
///
/// It has no poses: a response needs the arms, and World::object(contact.object_a()) has the pose of `a` in which the
/// pair was tested, until the next frame begins.
struct Contact {
  ObjectNumber a = 0;  ///< the lower of the two numbers
  ObjectNumber b = 0;
  Phase phase = Phase::begin;
  float depth = 0;  ///< metres, >= 0: the least translation of b along `normal` that separates the two
  Vec3f normal;     ///< unit vector from a to b
  float toi = 1;    ///< time of impact as a share of the frame; reserved: always 1, the end of the frame
  Vec3d point;      ///< world position midway between the two surfaces at the deepest place, metres
  Vec3f arm_a;      ///< from the position of a to `point`, world axes, metres: the lever of a force that acts there
  Vec3f arm_b;
  std::uint32_t generation_a = 0;  ///< see ObjectId
  std::uint32_t generation_b = 0;
  std::uint64_t user_data_a = 0;  ///< ObjectSpec::user_data of a
  std::uint64_t user_data_b = 0;
  std::uint32_t child_a = 0;  ///< part of a compound shape; reserved: always 0
  std::uint32_t child_b = 0;
  std::uint16_t layer_a = 0;  ///< ObjectSpec::layer of a
  std::uint16_t layer_b = 0;
  std::uint32_t flags = 0;  ///< reserved: always 0

  constexpr ObjectId object_a() const noexcept { return ObjectId::of(a, generation_a); }
  constexpr ObjectId object_b() const noexcept { return ObjectId::of(b, generation_b); }
};

static_assert(sizeof(Contact) == 120 && std::is_trivially_copyable_v<Contact>);

}  // namespace ringfence
