#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/host/move_scratch.hpp"
#include "nodes/move_watch.hpp"
#include "nodes/role.hpp"
#include "nodes/user/interest_reader.hpp"
#include "nodes/user/user_role.hpp"
#include "telemetry/step_clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

/// What a thread provides for the user nodes that it steps. Each pointer but `reader` may be null.
struct UserThreadParts {
  InterestReader* reader = nullptr;
  telemetry::Track* track = nullptr;      ///< null: no timeline
  telemetry::StepClock* clock = nullptr;  ///< null: not measured
  MoveWatch* watch = nullptr;             ///< null: the World does not abandon the thread
};

/// Configuration of the role of a user thread. What the pointers refer to outlives the role.
struct UserThreadSetup {
  Connection server;  ///< the thread's end, with the publication of its user nodes
  const Publications* publications = nullptr;
  UserThreadParts parts;
  std::uint64_t first_frame = 0;  ///< messages of frames before are ignored: they were sent to user nodes that are gone
};

/// The role that a user thread steps: it receives what the server sends to the user nodes of the thread, and makes each
/// of them do its part of the frame. No user node is polled, and one without contacts costs nothing at the end of a
/// frame.
///
/// All user nodes of a thread share one connection with the server, one publication, and the memory that they need only
/// while they are stepped. What the server sends to all of them (Endpoint::all_users()) they process one after the
/// other. The thread acknowledges the frame once for all. While one of them waits for room in the ring, the others wait
/// too.
///
/// Threads: one thread at a time steps it. It accesses no other memory after Step::abandoned. Throws only what a user
/// node throws. Memory: 8 bytes a user node.
class UserThreadRole {
 public:
  /// `users`: ascending by number; they outlive the role.
  UserThreadRole(const UserThreadSetup& setup, std::vector<UserRole*> users);
  /// The same for the thread that replaces the thread of `stalled`, which was abandoned in a move (MoveWatch): goes on
  /// where that role has stopped. `users`: those of `stalled` without the user node in whose move it is.
  UserThreadRole(const UserThreadRole& stalled, const UserThreadParts& parts, std::vector<UserRole*> users);
  UserThreadRole(const UserThreadRole&) = delete;
  UserThreadRole& operator=(const UserThreadRole&) = delete;

  /// Receives messages and continues the frame as far as possible.
  Step step();

 private:
  /// What the last message to all user nodes requires and is not done yet.
  enum class Task : std::uint8_t { none, move, send_published, read, send_frame_done };

  Step receive(std::span<const std::byte> bytes);
  void start(const messages::Header& header);
  Step resume();
  Step move_all();
  bool move(UserRole& user);
  void publish();
  void read_all();
  bool send_published();
  bool send_frame_done();
  void enter(telemetry::StepClock::Step step) noexcept;
  void prefetch_moves() const noexcept;
  void prefetch_reads() const noexcept;
  /// In users_: the first one whose number is not less.
  std::size_t position_of(UserNumber number) const noexcept;
  UserRole* find(UserNumber number) noexcept;

  UserThreadSetup setup_;
  std::vector<UserRole*> users_;
  std::size_t state_bytes_;
  MoveScratch scratch_;
  Task task_ = Task::none;
  std::uint64_t frame_ = 0;
  std::size_t next_;                ///< in users_: the first one that has not processed the last message to all
  UserRole* sending_ = nullptr;     ///< the user node that has moved and has not sent all states
  messages::RunSender run_;         ///< of its states, then of what the thread sends
  bool between_frames_ = true;      ///< no frame has begun, or all contacts of the last one have arrived
  std::uint32_t published_ = 0;     ///< number of states in this frame
  messages::NodeFrameStats stats_;  ///< of the user nodes that have moved in this frame
  std::size_t guess_ = 0;           ///< in users_: the one that the next message is probably for
};

}  // namespace ringfence::nodes
