#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Runs a soak with a journal in one process after another: each is killed at a random moment, except for the last, and
/// the next one continues its journal. Checks that no frame is missing which a process had completed (with --sync
/// always), and that frames that are run again have the digest that they had before.
///
/// Returns the exit code: check_failed if a check failed, here or in a process; else that of the last process. Throws
/// Error if the system cannot create a process. Precondition: this process has one thread.
int run_soak_lives(const RunOptions& options);

}  // namespace ringfence::tools
