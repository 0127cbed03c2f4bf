#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

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
};

/// One error in a frame. Pairs have a < b; b is 0 where the error concerns a single contact record.
struct Difference {
  ObjectNumber a = 0;
  ObjectNumber b = 0;
  std::string text;  ///< e.g. "frame 12: pair 17-203 (box, hull) missing: depth 0.0123 m"
};

/// Compares the contacts of a frame with brute force over all pairs. Returns every contact that is missing, extra,
/// duplicate, out of order, with wrong poses or phase, or wrong in itself (see describe_error), sorted by pair.
///
/// `objects` may be in any order and have distinct numbers, with shapes in `shapes`. Bit j of `layer_masks[i]` says
/// whether layers i and j collide; without masks all do. `contacts` are all begin and persist contacts of the frame and
/// must be sorted by (a, b). The exact test runs for the pairs whose boxes touch; the boxes are computed in double from
/// the shapes and widened by the band.
///
/// Threads: uses the threads of oneTBB; only the caller's thread if it runs in an arena of one. Computes in the default
/// floating-point environment. Cost: 4000 mixed objects with 2000 contacts take 16 ms of one core. Returns at most
/// `max_differences` differences, those of the lowest pairs.
std::vector<Difference> check_frame(std::uint64_t frame, const Shapes& shapes, std::span<const FrameObject> objects,
                                    std::span<const std::uint32_t> layer_masks, std::span<const Contact> contacts,
                                    const Tolerance& tolerance = {}, std::size_t max_differences = 100);

/// Checks the phases of a frame against its contacts and those of the previous frame: begin where the pair was not in
/// contact, persist where it was. `ended` (phase end, in any order) must hold each pair that is no longer in contact,
/// once, with the geometry and poses of the previous frame. The other spans are sorted by (a, b).
std::vector<Difference> check_phases(std::uint64_t frame, std::span<const Contact> before, std::span<const Contact> now,
                                     std::span<const Contact> ended);

}  // namespace ringfence::reference
