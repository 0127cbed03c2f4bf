#pragma once

#include <cstdint>
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
  bool is_connected(UserNumber user) const noexcept { return use_of(user) == Use::connected; }
  bool in_use(UserNumber user) const noexcept { return use_of(user) != Use::none; }
  /// One more than the highest number that was ever in use.
  std::size_t size() const noexcept { return uses_.size(); }
  /// The lowest number that is not in use.
  UserNumber free_number() noexcept;

  /// Precondition: not in_use(user).
  void connect(UserNumber user);
  /// Precondition: is_connected(user).
  void disconnect(UserNumber user);

  /// A frame begins: its cut disconnects the user nodes that were disconnected so far.
  void cut() noexcept { cut_leaving_.swap(leaving_); }
  /// Those that the cut of the running frame disconnects.
  std::span<const UserNumber> cut_leaving() const noexcept { return cut_leaving_; }
  /// The frame is complete: the numbers that its cut disconnected may be reused.
  void forget_cut() noexcept;

 private:
  enum class Use : std::uint8_t { none, connected, leaving };
  Use use_of(UserNumber user) const noexcept { return user < uses_.size() ? uses_[user] : Use::none; }

  std::vector<Use> uses_;            ///< by number
  UserNumber lowest_ = 0;            ///< all numbers below are in use
  std::vector<UserNumber> leaving_;  ///< disconnected since the last cut
  std::vector<UserNumber> cut_leaving_;
};

}  // namespace ringfence::facade
