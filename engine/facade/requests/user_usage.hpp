#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/numbers.hpp"
#include "ringfence/config.hpp"

namespace ringfence::facade {

/// Counts what each user asks for in a window of frames (Quotas::window), and
/// what was refused to it.
///
/// Threads: belongs to the thread that calls World. Memory: 32 bytes a user.
class UserUsage {
 public:
  explicit UserUsage(const Quotas& quotas) noexcept : quotas_(quotas) {}

  /// Counts a call, and returns whether it is within the quota. Calls beyond it
  /// do not count.
  bool take_spawn(UserNumber user) { return take(of(user).spawns, quotas_.spawns); }
  bool take_move(UserNumber user) { return take(of(user).moves, quotas_.moves); }
  void refuse(UserNumber user) { ++of(user).refused; }
  /// Calls refused to the user since it connected.
  std::uint64_t refused(UserNumber user) const noexcept { return user < users_.size() ? users_[user].refused : 0; }

  /// A user connects: nothing was refused to it. It keeps what a user with its
  /// number has used of the window.
  void connect(UserNumber user) { of(user).refused = 0; }
  /// A frame begins.
  void cut() noexcept { restore_window(frames_ + 1); }

  /// What a save keeps of a user.
  struct Counts {
    std::uint32_t spawns = 0, moves = 0;  ///< in the current window
  };
  Counts counts(UserNumber user) const noexcept {
    if (user >= users_.size()) {
      return {};
    }
    const Usage& usage = users_[user];
    const bool current = usage.window == window_;
    return {current ? usage.spawns : 0, current ? usage.moves : 0};
  }
  /// One more than the highest number that was used.
  std::size_t size() const noexcept { return users_.size(); }
  /// So many frames have begun.
  void restore_window(std::uint64_t frames) noexcept {
    frames_ = frames;
    window_ = frames_ / std::max<std::size_t>(1, quotas_.window);
  }
  /// After restore_window().
  void restore(UserNumber user, const Counts& counts) { of(user) = {window_, counts.spawns, counts.moves, 0}; }

 private:
  struct Usage {
    std::uint64_t window = 0;  ///< that of the next two
    std::uint32_t spawns = 0, moves = 0;
    std::uint64_t refused = 0;
  };

  Usage& of(UserNumber user) {
    if (user >= users_.size()) {
      users_.resize(std::size_t{user} + 1);
    }
    Usage& usage = users_[user];
    if (usage.window != window_) {
      usage.window = window_;
      usage.spawns = usage.moves = 0;
    }
    return usage;
  }
  static bool take(std::uint32_t& used, std::size_t quota) noexcept {
    const bool allowed = quota == 0 || used < quota;
    used += quota != 0 && allowed ? 1 : 0;
    return allowed;
  }

  const Quotas& quotas_;
  std::uint64_t frames_ = 0, window_ = 0;
  std::vector<Usage> users_;
};

}  // namespace ringfence::facade
