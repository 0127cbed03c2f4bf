#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace ringfence::tools {

/// A script that completes commands, options, words and file names of the program in bash (4.0 or later). It needs no
/// other package. Options and words are those of the parser.
std::string format_bash_completion(const CLI::App& app);

}  // namespace ringfence::tools
