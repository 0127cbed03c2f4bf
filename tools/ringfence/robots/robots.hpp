#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Runs clients that walk and check what they receive. Returns the exit code. Throws Error for invalid options.
int run_robots(const RobotsOptions& options);

}  // namespace ringfence::tools
