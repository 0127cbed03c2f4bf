#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Adds the options of `robots` to a command. `options` must outlive it.
void add_robots(CLI::App& command, RobotsOptions& options);

/// Runs clients that walk and check what they receive. Returns the exit code. Throws Error for invalid options.
int run_robots(const RobotsOptions& options);

}  // namespace ringfence::tools
