#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "facade/duplex_channel.hpp"
#include "facade/threads/worker.hpp"
#include "facade/world_state.hpp"
#include "nodes/move_watch.hpp"
#include "nodes/user/interest_reader.hpp"
#include "nodes/user/user_role.hpp"
#include "nodes/user/user_thread_role.hpp"
#include "ringfence/frame_report.hpp"
#include "telemetry/step_clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence::facade {

/// A thread that steps user nodes, with what it uses for all of them.
struct UserThread {
  UserThread(const nodes::Publications& publications, double interest) : reader(publications, interest) {}
  nodes::InterestReader reader;
  nodes::MoveWatch watch;
  nodes::MoveWatch::Move seen = nodes::MoveWatch::none;  ///< the move in which the last check found the thread
  telemetry::StepClock clock;
  telemetry::Track track;
  std::unique_ptr<nodes::UserThreadRole> role;  ///< null: it steps no user nodes
  std::unique_ptr<Worker> worker;               ///< null without threads; ends before the role is destroyed
  std::uint64_t cpu_ns = 0;                     ///< Worker::working_cpu_ns() at the end of the last frame
};

/// The threads that step the user nodes of a World, each with the connection between its user nodes and the server.
/// Without threads there is one entry, which stands for the thread that calls World.
///
/// A thread whose user node does not finish its move is *stalled*. It is replaced, and ends when the move returns. The
/// connection remains.
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
  /// The server's end of the connection of a thread. The first call for a thread allocates it.
  nodes::Connection connection(std::size_t index) { return channel(index).first(); }
  /// Replaces the user nodes that a thread steps, between frames. `users`: ascending by number. Blocks until the thread
  /// has finished with the old ones.
  void assign(std::size_t index, std::vector<nodes::UserRole*> users);
  /// The thread steps no user nodes until the next assign(). Blocks in the same way.
  void withdraw(std::size_t index) { assign_role(index, nullptr); }

  /// Indices of the threads that are in the same move as at the last check, at least a quarter of the deadline ago.
  /// Empty if the last check is more recent.
  std::vector<std::size_t> find_stalled();
  /// Starts a thread that is to replace a stalled one. Throws Error if the system has none.
  std::unique_ptr<UserThread> start_replacement() { return start_thread(); }
  /// Puts `replacement` in the place of an abandoned thread, which it returns. The new thread goes on with `users`,
  /// those of the old one without the one in whose move it is.
  std::unique_ptr<UserThread> replace(std::size_t index, std::unique_ptr<UserThread> replacement,
                                      std::vector<nodes::UserRole*> users);

  /// Writes the CPU times of the last frame into the report: its fields about users, and PathReport::user_*. Without
  /// threads all times of the path are 0.
  void report_times(FrameReport& report);

 private:
  std::unique_ptr<UserThread> start_thread();
  nodes::UserThreadParts parts_of(UserThread& thread) const noexcept;
  DuplexChannel& channel(std::size_t index);
  void assign_role(std::size_t index, std::unique_ptr<nodes::UserThreadRole> role);

  WorldState& state_;
  std::vector<std::unique_ptr<DuplexChannel>> channels_;  ///< by thread; null: it has had no user node
  std::vector<std::unique_ptr<UserThread>> threads_;
  std::uint64_t checked_ns_ = 0;  ///< time of the last check for stalled threads
};

}  // namespace ringfence::facade
