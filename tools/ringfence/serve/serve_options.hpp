#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "options.hpp"

namespace ringfence::tools {

/// Adds the options of `serve` to a command. `options` must outlive it.
void add_serve(CLI::App& command, ServeOptions& options);
/// Those that `resume` has too, for the journal of a served world.
void add_clients(CLI::App& command, ServeOptions& options);

}  // namespace ringfence::tools
