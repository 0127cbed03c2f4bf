#pragma once

#include <string>
#include <vector>

#include "options.hpp"

namespace ringfence::tools {

/// What a journal keeps of the command that wrote it, as JSON: the command and its options, with absolute paths of the
/// files that it reads.
std::string describe_run(const std::string& command, const std::vector<std::string>& given);

/// The options that `resume` replaces: all that is given except the directory and --accept-release.
std::vector<std::string> options_of_run(std::vector<std::string> given, const std::string& directory);

/// The command line of the run that a journal describes, without its outputs and faults, and with `replaced` instead of
/// the options of the same names. Throws Error if the description is not that of `run`, `replay` or `serve`.
std::vector<std::string> command_of(const std::string& description, const std::vector<std::string>& replaced);

/// Parses that command line. Throws Error with what is wrong.
CommandLine parse_command(const std::vector<std::string>& arguments);

}  // namespace ringfence::tools
