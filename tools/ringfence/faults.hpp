#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "ringfence/fault.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Reads "FRAME:NODE:STAGE", or several with commas between them: in counted frame FRAME the CD node that has number
/// NODE by then stops when it is about to do STAGE, a name of NodeStage with - for _. Throws Error with what is
/// expected.
std::vector<Fault> parse_faults(std::string_view text);

/// Throws Error unless each frame is below `frames`, there are nodes that can fail, and a deadline to notice it by.
void check_faults(const std::vector<Fault>& faults, std::uint32_t frames, std::uint32_t nodes, double deadline_ms);

/// Orders the faults of counted frame `frame`, which is frame `in_world` of the world. Throws Error if it refuses.
void inject_faults(const std::vector<Fault>& faults, std::uint32_t frame, std::uint64_t in_world, World& world);

}  // namespace ringfence::tools
