#pragma once

#include "job.hpp"
#include "options.hpp"

namespace ringfence::tools {

/// The world of `serve` as a job. Throws Error and InputError.
Job make_job(const ServeOptions& options);

/// Runs a world in real time for clients over the network, until its last frame or a signal. Returns the exit code.
/// Throws Error for invalid options, and IncompleteError if the world cannot go on.
int serve(const ServeOptions& options);

}  // namespace ringfence::tools
