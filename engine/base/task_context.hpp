#pragma once

#include <oneapi/tbb/task_group.h>

namespace ringfence::base {

/// A context for oneTBB's algorithms whose tasks run in the floating-point environment that the calling thread has now.
/// Without it they run in the environment that the thread had when it first used oneTBB, which may be the embedder's.
inline oneapi::tbb::task_group_context task_context() {
  using Context = oneapi::tbb::task_group_context;
  return Context(Context::bound, Context::default_traits | Context::fp_settings);
}

}  // namespace ringfence::base
