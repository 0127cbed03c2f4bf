#pragma once

#include <CLI/CLI.hpp>

#include "options.hpp"

namespace ringfence::tools {

/// Adds the options that are specific to `ringfence scale`. CommandLineParser adds those that it shares with `run`.
void add_scale_options(CLI::App& command, ScaleOptions& options);

}  // namespace ringfence::tools
