#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Runs `ringfence scale`: every combination of the options, `repeats` times, and a report. Repeats are whole rounds
/// over all combinations, so that disturbances of the machine affect all of them alike.
///
/// Returns the exit code: check_failed if runs with one object count have different digests or if a candidate was not
/// tested exactly once. Throws Error and IncompleteError.
int scale(const ScaleOptions& options);

}  // namespace ringfence::tools
