#pragma once

#include "ringfence/error.hpp"

namespace ringfence::tools {

/// Exit codes of the program.
enum ExitCode : int {
  done = 0,
  check_failed = 1,  ///< --check found a difference, or a candidate was not tested and accepted exactly once
  usage_error = 2,   ///< invalid options or input
  incomplete = 3,    ///< the run did not complete: for example a frame was refused, or a file could not be written
};

/// An error that ends the program with `incomplete`. Any other ringfence::Error ends it with `usage_error`.
class IncompleteError : public Error {
 public:
  using Error::Error;
};

}  // namespace ringfence::tools
