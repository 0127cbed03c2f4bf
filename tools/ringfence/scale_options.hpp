#pragma once

#include <CLI/CLI.hpp>

#include "options.hpp"

namespace ringfence::tools {

/// Adds the options of `ringfence scale` that are lists or its own; those that it shares with `run` are the parser's.
void add_scale_options(CLI::App& command, ScaleOptions& options);

}  // namespace ringfence::tools
