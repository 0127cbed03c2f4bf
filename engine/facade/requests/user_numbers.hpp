#pragma once

#include <span>
#include <vector>

#include "base/numbers.hpp"

namespace ringfence::facade {

/// The numbers of the user nodes known to the caller: answers calls at once, also while a frame is running.
///
/// The number of a user node that was disconnected stays in use until the frame whose cut disconnects it is complete.
///
/// Threads: belongs to the thread that calls World.
class UserNumbers {
 public:
  /// Whether the user node is connected, or connecting at the next cut.
  bool is_connected(UserNumber user) const noexcept;
  bool in_use(UserNumber user) const noexcept;
  /// The lowest number that is not in use.
  UserNumber free_number() const noexcept;

  /// Precondition: not in_use(user).
  void connect(UserNumber user);
  /// Precondition: is_connected(user).
  void disconnect(UserNumber user);

  /// A frame begins: its cut disconnects the user nodes that were disconnected so far.
  void cut() noexcept { cut_leaving_.swap(leaving_); }
  /// Those that the cut of the running frame disconnects.
  std::span<const UserNumber> cut_leaving() const noexcept { return cut_leaving_; }
  /// The frame is complete: the numbers that its cut disconnected may be reused.
  void forget_cut() noexcept { cut_leaving_.clear(); }

 private:
  std::vector<UserNumber> connected_;  ///< ascending
  std::vector<UserNumber> leaving_;    ///< disconnected since the last cut
  std::vector<UserNumber> cut_leaving_;
};

}  // namespace ringfence::facade
