#pragma once

#include <atomic>
#include <cstdint>

namespace ringfence::nodes {

/// Prevents a lost CD node that still runs from reading memory that others have started to overwrite.
///
/// There is one gate per node with shared memory and per step in which nodes read each other's data. The node enters
/// before it reads data of others. The server bars lost nodes; if a lost node is already inside, the server waits until
/// it leaves, some 100 us of copying without any wait of its own. If its thread has stopped there, the server gives up
/// all memory that it may access, after a deadline: see ServerRole. Threads: the server and the node.
class ReadGate {
 public:
  /// By the server, before it starts the step: the node may enter once.
  void admit() noexcept { state_.store(open, std::memory_order_relaxed); }
  /// By the node: whether it may read shared data. If true, it calls leave() afterwards.
  bool enter() noexcept {
    std::uint32_t expected = open;
    // Pairs with the exchange in bar(): exactly one of the two succeeds.
    return state_.compare_exchange_strong(expected, inside, std::memory_order_acq_rel);
  }
  void leave() noexcept { state_.store(left, std::memory_order_release); }
  /// By the server: the node may no longer enter. False if it has already entered.
  bool bar() noexcept {
    std::uint32_t expected = open;
    return state_.compare_exchange_strong(expected, barred, std::memory_order_acq_rel);
  }
  /// Whether the node is between enter() and leave(). After false, what it did before leave() is visible.
  bool is_inside() const noexcept { return state_.load(std::memory_order_acquire) == inside; }

 private:
  enum State : std::uint32_t { barred, open, inside, left };
  std::atomic<std::uint32_t> state_{barred};
};

}  // namespace ringfence::nodes
