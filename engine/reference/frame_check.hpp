#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/numbers.hpp"
#include "reference/contact_check.hpp"
#include "reference/shapes.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::reference {

/// An object of a frame, as input of the reference.
struct FrameObject {
  ObjectNumber number = 0;
  ShapeNumber shape = 0;
  std::uint8_t layer = 0;
  bool present = true;
  Pose pose;
  bool fixed = false;       ///< a static object: two of them are never in contact
  std::uint32_t group = 0;  ///< objects of one group other than 0 are never in contact
  std::uint32_t generation = 0;
  std::uint64_t user_data = 0;
  std::uint32_t user = no_user_number;  ///< of an avatar
  bool excess = false;                  ///< in no contact with another avatar of its user, see
                                        ///< mark_excess()
};

/// Sets `excess` for the objects of each user except its `colliding` objects with the lowest numbers. 0: for none.
void mark_excess(std::span<FrameObject> objects, std::size_t colliding);

/// One error in a frame, with the object numbers of its pair. a < b, unless the error is that a contact has a >= b.
struct Difference {
  ObjectNumber a = 0;
  ObjectNumber b = 0;
  std::string text;  ///< e.g. "frame 12: pair 17-203 (box, hull) missing: depth 0.0123 m"
};

/// Compares the contacts of a frame with those that the exact test finds. Returns one Difference for each error, sorted
/// by pair: a contact is missing, extra, not among the deepest, listed twice, out of order, has a >= b, names an
/// unknown object, has the wrong ids, user data, layers, arms or reserved fields, or the phase end, or is wrong in
/// itself (see describe_error). Returns at most `max_differences`, those of the lowest pairs.
///
/// `objects` may be in any order and have distinct numbers, with shapes in `shapes`. Bit j of `layer_masks[i]` says
/// whether layers i and j collide; if `layer_masks` is empty, all layers collide. `contacts` are all begin and persist
/// contacts of the frame; that they are in order of (a, b) is checked. The exact test runs for all pairs in `contacts`
/// and for all pairs whose boxes touch. The boxes are computed in double from the shapes and widened by the band().
///
/// `deepest_contacts`: as in WorldConfig. If it is not 0, a contact may be missing unless it is certainly among so many
/// deepest ones of one of its objects, and must not be listed unless it may be. Depths of listed contacts are taken as
/// reported, those of others are known within the band().
///
/// Threads: uses the threads of oneTBB; only the caller's thread if it runs in an arena of one. Computes in the default
/// floating-point environment. Cost: 4000 mixed objects with 2000 contacts take 16 ms of one core.
std::vector<Difference> check_frame(std::uint64_t frame, const Shapes& shapes, std::span<const FrameObject> objects,
                                    std::span<const std::uint32_t> layer_masks, std::span<const Contact> contacts,
                                    std::size_t deepest_contacts = 0, const Tolerance& tolerance = {},
                                    std::size_t max_differences = 100);

/// Checks the phases of a frame. A contact in `now` must have the phase begin if its pair is not in `before`, the
/// contacts of the previous frame, and otherwise persist. `ended` must contain each pair that is no longer in contact,
/// once, with the phase end and all else as in the previous frame. Returns one Difference for each error,
/// not sorted.
///
/// Precondition: `before` and `now` are in order of (a, b); `ended` may be in any order. May be called from any thread.
std::vector<Difference> check_phases(std::uint64_t frame, std::span<const Contact> before, std::span<const Contact> now,
                                     std::span<const Contact> ended);

}  // namespace ringfence::reference
