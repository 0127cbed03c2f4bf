#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Continues the run that a journal describes. Returns the exit code; throws as run_job.
int resume(const ResumeOptions& options);

}  // namespace ringfence::tools
