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

/// The progress of one thread of a test, for the watchdog. Written by that thread only.
class alignas(cache_line_pair_bytes) ThreadProgress {
 public:
  explicit ThreadProgress(std::string name) : name_(std::move(name)) {}

  /// The thread has made progress.
  void note_progress() noexcept { steps_.fetch_add(1, std::memory_order_relaxed); }
  /// The thread is about to wait for `what`, a string literal; null if it continues.
  void set_waiting_for(const char* what) noexcept { waits_for_.store(what, std::memory_order_relaxed); }
  /// The thread is done.
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
/// and how many steps it has done, and ends the process with exit code 1: single threads cannot be ended.
class Watchdog {
 public:
  explicit Watchdog(std::string test, std::chrono::milliseconds timeout = std::chrono::seconds(60));
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;
  ~Watchdog();

  /// Registers a thread; the result lives as long as the watchdog.
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
