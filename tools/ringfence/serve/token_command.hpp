#pragma once

#include <string>

#include "options.hpp"

namespace ringfence::tools {

/// The key for tokens in a file, without the newline at its end. Throws Error if it cannot be read.
std::string read_token_key(const std::string& path);

/// Prints a token. Returns the exit code. Throws Error for an invalid key.
int print_token(const TokenOptions& options);

}  // namespace ringfence::tools
