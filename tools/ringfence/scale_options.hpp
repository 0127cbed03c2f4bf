#pragma once

#include <CLI/CLI.hpp>

#include "options.hpp"

namespace ringfence::tools {

/// Each function adds options that are specific to `ringfence scale`, in one group of option_groups.hpp.
/// CommandLineParser adds those that it shares with `run`.
void add_scale_world(CLI::App& command, ScaleOptions& options);
void add_scale_service(CLI::App& command, ScaleOptions& options);
void add_scale_output(CLI::App& command, ScaleOptions& options);

}  // namespace ringfence::tools
