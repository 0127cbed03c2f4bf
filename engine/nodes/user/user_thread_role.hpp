#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "messages/header.hpp"
#include "nodes/role.hpp"
#include "nodes/user/user_role.hpp"

namespace ringfence::nodes {

/// The role that a user thread steps: receives what the server sends to the user nodes of the thread, and passes each
/// message to its user node. So a frame costs what its messages cost, and no user node is polled.
///
/// All user nodes of a thread share one connection with the server. What the server sends to all of them
/// (Endpoint::all_users()) they process one after the other. While one of them waits for room in the ring, the others
/// wait too.
///
/// Threads: one thread at a time steps it. It accesses no other memory after Step::abandoned. Throws only what a user
/// node throws. Memory: 8 bytes a user node.
class UserThreadRole {
 public:
  /// `server`: the thread's end of the connection. `users`: ascending by number; they outlive the role. Messages of
  /// frames before `first_frame` are ignored: they were sent to user nodes that are gone.
  UserThreadRole(const Connection& server, std::vector<UserRole*> users, std::uint64_t first_frame);
  /// The same for the thread that replaces the thread of `stalled`, which was abandoned in a move (MoveWatch): goes on
  /// where that role has stopped. `users`: those of `stalled` without the user node in whose move it is.
  UserThreadRole(const UserThreadRole& stalled, std::vector<UserRole*> users);
  UserThreadRole(const UserThreadRole&) = delete;
  UserThreadRole& operator=(const UserThreadRole&) = delete;

  /// Receives messages and continues the frame as far as possible.
  Step step();

 private:
  Step receive(std::span<const std::byte> bytes);
  Step resume();
  Step pass_to_all();
  void prefetch_next(bool begins) const noexcept;
  /// In users_: the first one whose number is not less.
  std::size_t position_of(UserNumber number) const noexcept;
  UserRole* find(UserNumber number) noexcept;

  Connection server_;
  std::vector<UserRole*> users_;
  std::uint64_t first_frame_;
  std::size_t state_bytes_;
  UserRole* blocked_ = nullptr;  ///< the user node that waits for room in the ring
  // The last message to all user nodes.
  messages::MessageType to_all_ = messages::MessageType::frame_begin;
  std::uint64_t frame_ = 0;
  std::size_t next_;       ///< in users_: the first one that has not processed it
  std::size_t guess_ = 0;  ///< in users_: the one that the next message is probably for
};

}  // namespace ringfence::nodes
