#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <thread>

#include "link/atomics.hpp"

namespace ringfence::link {

/// The progress of one thread of a test, for the watchdog. Only that thread calls the member functions.
class alignas(cache_line_pair_bytes) ThreadProgress {
 public:
  explicit ThreadProgress(std::string name) : name_(std::move(name)) {}

  /// Call it when the thread has made progress.
  void note_progress() noexcept { steps_.fetch_add(1, std::memory_order_relaxed); }
  /// Call it before the thread waits for `what`, a string literal, and with null when it continues. Does not count as
  /// progress.
  void set_waiting_for(const char* what) noexcept { waits_for_.store(what, std::memory_order_relaxed); }
  /// Call it when the thread is done. Counts as progress.
  void set_done() noexcept {
    note_progress();
    done_.store(true, std::memory_order_relaxed);
  }

 private:
  friend class Watchdog;

  std::string name_;
  std::atomic<std::uint64_t> steps_{0};
  std::atomic<const char*> waits_for_{nullptr};
  std::atomic<bool> done_{false};
};

/// Ends a test that hangs. If none of its threads makes progress for `timeout`, it prints what each thread waits for
/// and how many steps it has done, and ends the process with exit code 1, because a single thread cannot be ended. It
/// compares the progress once per `timeout`, in a thread of its own. The destructor ends the observation.
class Watchdog {
 public:
  explicit Watchdog(std::string test, std::chrono::milliseconds timeout = std::chrono::seconds(60));
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;
  ~Watchdog();

  /// Registers a thread of the test. Any thread may call it. The result lives as long as the watchdog.
  ThreadProgress& add_thread(std::string name);

 private:
  void watch();
  std::uint64_t total_steps();
  std::string report();

  const std::string test_;
  const std::chrono::milliseconds timeout_;
  std::mutex mutex_;
  std::condition_variable stop_signal_;
  std::deque<ThreadProgress> threads_;
  bool stopped_ = false;
  std::thread thread_;
};

}  // namespace ringfence::link
