#pragma once

#include <atomic>
#include <cstdint>

#include "base/numbers.hpp"

namespace ringfence::nodes {

/// Shows in which user node's move a thread is. So the World can replace a thread that does not finish a move, usually
/// because a motion model does not return.
///
/// The thread enters before a user node moves, and leaves before the result is visible to others. In between, another
/// thread may abandon it. Then leave() returns false, and the thread must end without access to shared memory.
///
/// Threads: enter() and leave() by the watched thread; current() and abandon() by one other thread.
class MoveWatch {
 public:
  /// Identifies one move of a user node. A MoveWatch uses each value once.
  using Move = std::uint64_t;
  static constexpr Move none = 0;

  void enter(UserNumber user) noexcept {
    move_ = ++moves_ << 32 | user;
    // Pairs with the exchange in abandon(): the replacement of this thread sees all that it did to its other roles.
    state_.store(move_, std::memory_order_release);
  }
  /// Returns false if the thread was abandoned.
  bool leave() noexcept {
    Move expected = move_;
    return state_.compare_exchange_strong(expected, none, std::memory_order_acq_rel, std::memory_order_acquire);
  }

  /// The move that the thread is in, or none.
  Move current() const noexcept { return state_.load(std::memory_order_acquire); }
  /// Abandons the thread if it is still in `move`. Returns whether it did.
  bool abandon(Move move) noexcept {
    return state_.compare_exchange_strong(move, abandoned, std::memory_order_acq_rel, std::memory_order_acquire);
  }
  /// The user node of a move.
  static constexpr UserNumber user_of(Move move) noexcept { return static_cast<UserNumber>(move); }

 private:
  static constexpr Move abandoned = ~Move{0};

  std::atomic<Move> state_{none};
  Move move_ = none;  ///< accessed by the watched thread only
  Move moves_ = 0;    ///< accessed by the watched thread only
};

}  // namespace ringfence::nodes
