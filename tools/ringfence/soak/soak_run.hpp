#pragma once

#include <cstdint>

#include "job.hpp"
#include "journal_run.hpp"

namespace ringfence::tools {

/// The job with what a soak needs: deadlines, and no end.
Job soak_job(Job job);
/// The world of such a job: users have quotas, which the soak exceeds, and losses are not logged.
WorldConfig soak_config(const Job& job);

/// Runs a soak of the job's world for `minutes` and prints a summary. With --check compares one frame in 16 with brute
/// force. `observe` is called after each frame, also for those that are run again from a journal; `restored`, if not
/// null, when the world stands and its first new frame has not begun.
///
/// Returns the exit code: check_failed if a check failed, or if allocated memory has grown by more than a quarter since
/// a tenth of the time had passed, else incomplete if SIGINT or SIGTERM ended the soak.
int run_soak(const Job& job, double minutes, std::uint64_t seed, const FrameObserver& observe = {},
             const FrameObserver& restored = {});

}  // namespace ringfence::tools
