#include "link/watchdog.hpp"

#include <cstdio>
#include <cstdlib>
#include <utility>

namespace ringfence::link {

Watchdog::Watchdog(std::string test, std::chrono::milliseconds timeout)
    : test_(std::move(test)), timeout_(timeout), thread_([this] { watch(); }) {}

Watchdog::~Watchdog() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  stop_signal_.notify_all();
  thread_.join();
}

ThreadProgress& Watchdog::add_thread(std::string name) {
  const std::lock_guard lock(mutex_);
  return threads_.emplace_back(std::move(name));
}

void Watchdog::watch() {
  std::unique_lock lock(mutex_);
  std::uint64_t seen = total_steps();
  while (!stop_signal_.wait_for(lock, timeout_, [&] { return stopped_; })) {
    const std::uint64_t now = total_steps();
    if (now == seen) {
      std::fputs(report().c_str(), stderr);
      std::fflush(stderr);
      std::_Exit(1);
    }
    seen = now;
  }
}

std::uint64_t Watchdog::total_steps() {
  std::uint64_t sum = 0;
  for (const ThreadProgress& thread : threads_) sum += thread.steps_.load(std::memory_order_relaxed);
  return sum;
}

std::string Watchdog::report() {
  std::string text =
      "\"" + test_ + "\" hangs: no thread made progress for " + std::to_string(timeout_.count()) + " ms\n";
  for (const ThreadProgress& thread : threads_) {
    const char* awaited = thread.waits_for_.load(std::memory_order_relaxed);
    text += "  " + thread.name_;
    if (thread.done_.load(std::memory_order_relaxed)) {
      text += " is done";
    } else if (awaited) {
      text += std::string(" waits for ") + awaited;
    } else {
      text += " runs";
    }
    text += ", after " + std::to_string(thread.steps_.load(std::memory_order_relaxed)) + " steps\n";
  }
  return text;
}

}  // namespace ringfence::link
