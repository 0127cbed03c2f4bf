#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "facade/threads/worker.hpp"
#include "facade/world_state.hpp"
#include "nodes/move_watch.hpp"
#include "nodes/user/user_role.hpp"
#include "ringfence/frame_report.hpp"
#include "telemetry/step_clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence::facade {

/// A thread that steps user nodes, with what it uses for all of them.
struct UserThread {
  nodes::MoveWatch watch;
  nodes::MoveWatch::Move seen = nodes::MoveWatch::none;  ///< the move in which the last check found the thread
  telemetry::StepClock clock;
  telemetry::Track track;
  std::unique_ptr<Worker> worker;  ///< null without threads
  std::uint64_t cpu_ns = 0;        ///< CPU time that the thread had used at the end of the last frame
};

/// The threads that step the user nodes of a World. Without threads there is one entry, which stands for the thread
/// that calls World.
///
/// A thread whose user node does not finish its move is *stalled*. It is replaced, and ends when the move returns.
///
/// Threads: the one that calls World, between frames; find_stalled() and replace() also while the server waits for user
/// nodes. The destructor waits for the threads.
class UserThreads {
 public:
  explicit UserThreads(WorldState& state) noexcept : state_(state) {}
  UserThreads(const UserThreads&) = delete;
  UserThreads& operator=(const UserThreads&) = delete;

  /// Starts as many threads as the configuration says. Throws Error if the system has none for one of them.
  void start();
  std::size_t size() const noexcept { return threads_.size(); }
  /// The thread with that index. Precondition: index < size().
  UserThread& at(std::size_t index) const noexcept { return *threads_[index]; }
  /// The doorbell of a thread; null without threads.
  link::Doorbell* bell(std::size_t index) const noexcept;
  /// What a thread provides for its user nodes.
  nodes::UserThreadParts parts_of(UserThread& thread) const noexcept;
  /// Replaces the roles that a thread steps. Blocks until the thread has finished with the old ones.
  void assign(std::size_t index, std::vector<Steppable> roles);

  /// Indices of the threads that are in the same move as at the last check, at least a quarter of the deadline ago.
  /// Empty if the last check is more recent.
  std::vector<std::size_t> find_stalled();
  /// Starts a thread that is to replace a stalled one. Throws Error if the system has none.
  std::unique_ptr<UserThread> start_replacement() { return start_thread(); }
  /// Puts `replacement` in the place of a thread, which it returns.
  std::unique_ptr<UserThread> replace(std::size_t index, std::unique_ptr<UserThread> replacement) noexcept;

  /// Writes the CPU times of the last frame into the report: its fields about users, and PathReport::user_*. Without
  /// threads all times of the path are 0.
  void report_times(FrameReport& report);

 private:
  std::unique_ptr<UserThread> start_thread();

  WorldState& state_;
  std::vector<std::unique_ptr<UserThread>> threads_;
  std::uint64_t checked_ns_ = 0;  ///< time of the last check for stalled threads
};

}  // namespace ringfence::facade
