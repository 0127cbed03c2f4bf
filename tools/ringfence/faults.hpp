#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "ringfence/fault.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Parses the value of --fail: "FRAME:NODE:STAGE", or several separated by commas. In counted frame FRAME the CD node
/// that has the number NODE in that frame stops at STAGE. "uUSER" in place of NODE is a user node. Counted frames are
/// those after the warm-up, from 0. If the text is invalid, throws Error, which states the expected form.
std::vector<Fault> parse_faults(std::string_view text);

/// Throws Error if there are faults but no CD nodes (`nodes` is 0), if the frame of a fault is not below `frames`, the
/// number of counted frames, or if the deadline for its kind of role is 0.
void check_faults(const std::vector<Fault>& faults, std::uint32_t frames, std::uint32_t nodes,
                  const Deadlines& deadlines);

/// Injects the faults of counted frame `frame` into `world`. `in_world` is the number of that frame in the world, which
/// includes the warm-up. Call it before the frame begins. Throws Error if the world refuses a fault.
void inject_faults(const std::vector<Fault>& faults, std::uint32_t frame, std::uint64_t in_world, World& world);

}  // namespace ringfence::tools
