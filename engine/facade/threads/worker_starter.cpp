#include "facade/threads/worker_starter.hpp"

#include <string>

#include "ringfence/error.hpp"

namespace ringfence::facade {

bool WorkerStarter::start(Worker& worker, std::chrono::nanoseconds tick) {
  if (starts_until_failure_ && (*starts_until_failure_)-- == 0) {
    starts_until_failure_.reset();
    return false;
  }
  if (!worker.start(halt_, config_.pin ? &cores_ : nullptr, config_.pin ? next_core_ : Worker::unpinned, tick)) {
    return false;
  }
  ++next_core_;
  return true;
}

void WorkerStarter::must_start(Worker& worker, std::chrono::nanoseconds tick) {
  if (!start(worker, tick)) {
    throw_no_thread();
  }
}

void WorkerStarter::throw_no_thread() const {
  throw Error("WorldConfig: the system has no thread for one of " + std::to_string(config_.nodes) + " CD nodes, " +
              std::to_string(config_.user_threads) +
              " user threads and the server; ask for fewer, or raise the limit on threads (ulimit -u, pids.max)");
}

}  // namespace ringfence::facade
