#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Adds the options of `robots` to a command. `options` must outlive it.
void add_robots(CLI::App& command, RobotsOptions& options);

}  // namespace ringfence::tools
