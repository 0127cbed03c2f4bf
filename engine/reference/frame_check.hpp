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

/// An object of a frame as the reference sees it.
struct FrameObject {
  ObjectNumber number = 0;
  ShapeNumber shape = 0;
  std::uint8_t layer = 0;
  bool present = true;
  Pose pose;
};

/// One thing that is wrong with a frame. Pairs have a < b; b is 0 where a single contact record is meant.
struct Difference {
  ObjectNumber a = 0;
  ObjectNumber b = 0;
  std::string text;  ///< e.g. "frame 12: pair 17-203 (box, hull) missing: depth 0.0123 m"
};

/// Compares the contacts of a frame with brute force over all pairs: every contact that is missing, extra, there
/// twice, out of order, of the wrong poses or phase, or wrong in itself (see describe_error), sorted by pair.
///
/// `objects` in any order, distinct numbers, shapes in `shapes`; bit j of `layer_masks[i]` says whether layers i and j
/// collide, no masks that all do. `contacts` are all begin and persist contacts of the frame, which must be sorted by
/// (a, b). Pairs are tested exactly where their boxes, taken in double from the shapes and widened by the band, touch.
///
/// Threads: uses oneTBB's; the caller's alone if it has put itself in an arena of one. Cost: 4000 mixed objects
/// with 2000 contacts take 16 ms of one core. At most `most` differences are told, the lowest pairs; the rest are left
/// out.
std::vector<Difference> check_frame(std::uint64_t frame, const Shapes& shapes, std::span<const FrameObject> objects,
                                    std::span<const std::uint32_t> layer_masks, std::span<const Contact> contacts,
                                    const Tolerance& tolerance = {}, std::size_t most = 100);

/// Compares the phases of a frame with its contacts and those of the frame before: begin where the pair was not in
/// contact, persist where it was, and in `ended` (phase end, any order) each pair that is no more, once, with the
/// geometry and poses that it had. All but `ended` sorted by (a, b).
std::vector<Difference> check_phases(std::uint64_t frame, std::span<const Contact> before, std::span<const Contact> now,
                                     std::span<const Contact> ended);

}  // namespace ringfence::reference
