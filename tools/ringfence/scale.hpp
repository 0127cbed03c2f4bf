#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Runs `ringfence scale`: a run for every combination of object count, deployment, placement and node count in the
/// options, `repeats` times, and a report. Each repeat is a round over all combinations, so that a disturbance of the
/// machine affects all of them about equally.
///
/// Returns the exit code: check_failed if runs with one object count have different digests or if a candidate was not
/// tested exactly once, otherwise done. Throws Error for invalid options, and IncompleteError if a run or an output
/// cannot be completed.
int scale(const ScaleOptions& options);

}  // namespace ringfence::tools
