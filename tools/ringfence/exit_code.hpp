#pragma once

#include "ringfence/error.hpp"

namespace ringfence::tools {

/// What the program ends with.
enum ExitCode : int {
  done = 0,
  check_failed = 1,  ///< --check found a difference, or a pair was not tested and accepted exactly once
  usage_error = 2,   ///< options or input that cannot be
  incomplete = 3,    ///< the run could not be completed: a frame was refused, a file could not be written
};

/// Ends the program with `incomplete`. Every other ringfence::Error ends it with `usage_error`.
class IncompleteError : public Error {
 public:
  using Error::Error;
};

}  // namespace ringfence::tools
