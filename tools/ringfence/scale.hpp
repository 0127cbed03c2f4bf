#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// `ringfence scale`: runs every combination `repeats` times, a whole round after the other so that what the machine
/// does meanwhile falls on all of them, and reports. Answers the exit code: check_failed if runs of one object count
/// differ in their digest or a pair was not tested exactly once. Throws Error, IncompleteError.
int scale(const ScaleOptions& options);

}  // namespace ringfence::tools
