#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace ringfence::tools {

/// What is wrong with a command line, in one line that reads forwards: the option, what was found, what is expected,
/// and if possible what was meant. For example "--node: unknown option; did you mean --nodes?".
///
/// `error` is what `app`, or a command of it, has thrown in its last parse.
std::string usage_message(const CLI::App& app, const CLI::ParseError& error);

/// "run, replay, record, scale, profile, node or convert"
std::string list_commands(const CLI::App& app);

}  // namespace ringfence::tools
