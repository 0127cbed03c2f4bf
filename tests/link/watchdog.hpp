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

/// Where one thread of a test says what it does, for its watchdog to look at. Written by that thread alone.
class alignas(cache_line_pair_bytes) Post {
 public:
  explicit Post(std::string name) : name_(std::move(name)) {}

  /// The thread got somewhere.
  void moves() noexcept { moves_.fetch_add(1, std::memory_order_relaxed); }
  /// The thread is about to wait for what `what` says; a literal. Null when it goes on.
  void waits_for(const char* what) noexcept { waits_for_.store(what, std::memory_order_relaxed); }
  /// The thread is done.
  void leaves() noexcept {
    moves();
    left_.store(true, std::memory_order_relaxed);
  }

 private:
  friend class Watchdog;

  std::string name_;
  std::atomic<std::uint64_t> moves_{0};
  std::atomic<const char*> waits_for_{nullptr};
  std::atomic<bool> left_{false};
};

/// Ends a test that hangs: when for `patience` none of its threads has got anywhere, it prints who waits for what and
/// how far each has come, and ends the process with 1. Threads that hang cannot be ended one by one.
class Watchdog {
 public:
  explicit Watchdog(std::string test, std::chrono::milliseconds patience = std::chrono::seconds(60));
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;
  ~Watchdog();

  /// A thread's post; lives as long as the watchdog.
  Post& post(std::string name);

 private:
  void watch();
  std::uint64_t moves();
  std::string report();

  const std::string test_;
  const std::chrono::milliseconds patience_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Post> posts_;
  bool over_ = false;
  std::thread thread_;
};

}  // namespace ringfence::link
