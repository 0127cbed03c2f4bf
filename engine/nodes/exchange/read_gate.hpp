#pragma once

#include <atomic>
#include <cstdint>

namespace ringfence::nodes {

/// Keeps a CD node that is lost from reading what others have gone on to write: it may be late rather than dead.
///
/// Of each node that shares memory, for each step of a frame in which nodes read each other's. Before it reads what is
/// not its own, the node enters; the server bars those that are lost. Whoever is inside by then is awaited: some
/// hundred microseconds of copying, without a wait of its own. Threads: the server and the node.
class ReadGate {
 public:
  /// The server, before it tells the node of the step: the node may enter, once.
  void admit() noexcept { state_.store(open, std::memory_order_relaxed); }
  /// The node: whether it may read what others share. If so, it leaves() when it has.
  bool enter() noexcept {
    std::uint32_t expected = open;
    // Pairs with itself in bar(): one of the two comes first.
    return state_.compare_exchange_strong(expected, inside, std::memory_order_acq_rel);
  }
  void leave() noexcept { state_.store(left, std::memory_order_release); }
  /// The server: the node enters no more. False if it has already entered.
  bool bar() noexcept {
    std::uint32_t expected = open;
    return state_.compare_exchange_strong(expected, barred, std::memory_order_acq_rel);
  }
  /// Whether the node is between enter() and leave(). What it did before it left is visible after the answer false.
  bool is_inside() const noexcept { return state_.load(std::memory_order_acquire) == inside; }

 private:
  enum State : std::uint32_t { barred, open, inside, left };
  std::atomic<std::uint32_t> state_{barred};
};

}  // namespace ringfence::nodes
