#pragma once

#include <array>

#include "ringfence/error.hpp"

namespace ringfence::tools {

/// Exit codes of the program.
enum ExitCode : int {
  done = 0,
  check_failed = 1,  ///< --check found a difference, or a candidate was not tested and accepted exactly once
  usage_error = 2,   ///< invalid options or input
  /// The run did not complete: a signal ended it, a frame was refused, or a file could not be written.
  incomplete = 3,
};

/// What an exit code means, for the help and the manual page.
struct ExitCodeText {
  ExitCode code;
  const char* text;
};
inline constexpr std::array exit_codes{
    ExitCodeText{done, "done"},
    ExitCodeText{check_failed, "a check found a difference, or a pair was not tested and accepted exactly once"},
    ExitCodeText{usage_error, "invalid options or input"},
    ExitCodeText{incomplete, "not complete: ended by SIGINT or SIGTERM, or a file could not be written"},
};

/// An error that ends the program with `incomplete`. Any other ringfence::Error ends it with `usage_error`.
class IncompleteError : public Error {
 public:
  using Error::Error;
};

}  // namespace ringfence::tools
