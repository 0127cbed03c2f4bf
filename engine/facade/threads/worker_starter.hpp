#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "facade/threads/worker.hpp"
#include "link/cores.hpp"
#include "ringfence/config.hpp"

namespace ringfence::facade {

/// Starts the threads of a World. With WorldConfig::pin each thread gets a core of its own in the order of the starts,
/// as far as there are enough: the server and the first CD nodes get theirs first, and the others share.
///
/// Threads: the one that calls World.
class WorkerStarter {
 public:
  /// `config` and `halt` outlive this object and the threads; this object outlives the threads.
  WorkerStarter(const WorldConfig& config, Halt& halt) : config_(config), halt_(halt) {}
  WorkerStarter(const WorkerStarter&) = delete;
  WorkerStarter& operator=(const WorkerStarter&) = delete;

  /// Starts the thread of `worker`, which steps its roles at least every `tick`; 0: only when its bell rings. Returns
  /// false if the system has no thread.
  [[nodiscard]] bool start(Worker& worker, std::chrono::nanoseconds tick = {});
  /// The same; throws Error if the system has no thread.
  void must_start(Worker& worker, std::chrono::nanoseconds tick = {});
  /// Throws the Error of a World that lacks a thread at its construction.
  [[noreturn]] void throw_no_thread() const;
  /// For tests: one start fails after `succeed_first` further starts.
  void fail_after(std::uint32_t succeed_first) noexcept { starts_until_failure_ = succeed_first; }

 private:
  const WorldConfig& config_;
  Halt& halt_;
  link::Cores cores_;
  std::size_t next_core_ = 0;
  std::optional<std::uint32_t> starts_until_failure_;
};

}  // namespace ringfence::facade
