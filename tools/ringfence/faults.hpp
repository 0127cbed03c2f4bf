#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "ringfence/fault.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Parses the value of --fail: "FRAME:NODE:STAGE", or several separated by commas. In counted frame FRAME the CD node
/// that has the number NODE in that frame stops at STAGE. "uUSER" in place of NODE is a user node. Throws Error that
/// states the expected form.
std::vector<Fault> parse_faults(std::string_view text);

/// Throws Error unless each frame is below `frames`, there are CD nodes, and the deadline for each fault is set.
void check_faults(const std::vector<Fault>& faults, std::uint32_t frames, std::uint32_t nodes,
                  const Deadlines& deadlines);

/// Injects the faults of counted frame `frame` into `world`, where it has the number `in_world`. Throws Error if the
/// world refuses one. To be called before that frame.
void inject_faults(const std::vector<Fault>& faults, std::uint32_t frame, std::uint64_t in_world, World& world);

}  // namespace ringfence::tools
