#pragma once

#include <atomic>
#include <cstdint>

namespace ringfence::nodes {

/// Prevents a lost CD node that still runs from reading memory that others have started to overwrite.
///
/// There is one gate per node with shared memory and per step in which nodes read each other's data. The node enters
/// its gate before it reads data of others. The server bars the gates of lost nodes. If a lost node is already inside,
/// the server waits until it leaves: about 100 us, because the node only copies and waits for nothing. If the thread of
/// the node has stopped inside, the server gives up, after a deadline, all memory that this thread may access: see
/// Deadlines.
///
/// Threads: the server and the node.
class ReadGate {
 public:
  /// By the server, before it announces the step: the node may enter once. Relaxed, because the node enters after it
  /// has read the announcement.
  void admit() noexcept { state_.store(open, std::memory_order_relaxed); }
  /// By the node: whether it may read shared data. If true, it calls leave() when it has finished.
  bool enter() noexcept {
    std::uint32_t expected = open;
    // Pairs with the exchange in bar(): at most one of the two succeeds.
    return state_.compare_exchange_strong(expected, inside, std::memory_order_acq_rel);
  }
  /// By the node, after enter() returned true. The release store pairs with the load in is_inside().
  void leave() noexcept { state_.store(left, std::memory_order_release); }
  /// By the node, instead of leave(): it may enter again.
  void pause() noexcept { state_.store(open, std::memory_order_release); }
  /// By the server: the node may no longer enter. Returns false if the node has already entered, or is barred already.
  bool bar() noexcept {
    std::uint32_t expected = open;
    return state_.compare_exchange_strong(expected, barred, std::memory_order_acq_rel);
  }
  /// By the server: whether the node is between enter() and leave(). If false, all that the node did before leave() is
  /// visible.
  bool is_inside() const noexcept { return state_.load(std::memory_order_acquire) == inside; }
  /// By the server: bars a gate that the node may pause in. Returns false if the node is inside; then call it again. If
  /// true, the node does not enter any more, and all that it did inside is visible.
  bool close() noexcept {
    std::uint32_t expected = open;
    return state_.compare_exchange_strong(expected, barred, std::memory_order_acq_rel, std::memory_order_acquire) ||
           expected != inside;
  }

 private:
  enum State : std::uint32_t { barred, open, inside, left };
  std::atomic<std::uint32_t> state_{barred};
};

}  // namespace ringfence::nodes
