#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace ringfence::tools {

/// The manual page ringfence(1) in the format of man(7): commands, options by group, exit codes, signals and examples.
/// Options and their descriptions are those of the parser. It has no date, so the same program makes the same page.
std::string format_manual_page(const CLI::App& app, const std::string& version);

}  // namespace ringfence::tools
