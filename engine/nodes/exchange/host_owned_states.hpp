#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/flat_list.hpp"
#include "messages/records.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::nodes {

/// S(k) of one object, without the model's state: one cache line.
struct alignas(64) HostOwnedState {
  messages::ObjectRef object;
  Pose pose;
};
static_assert(sizeof(HostOwnedState) == 64);

/// Host-owned states of a CD node, kept for recovery: states that the node moved and did not send to the server, in
/// memory that both share. They replace `node_state` messages.
///
/// The server reads them only when the node is lost; from a live node it reads the Host. Two frames are kept, by
/// parity: S(k - 1) does not change while S(k) is written, even if the writer is a lost node that still runs. Written
/// with non-temporal stores where available, because they are rarely read.
///
/// Threads: one writer. The server may read the last frame after the node has reported its moves and until the next
/// frame begins, and the frame before at any time during a frame. Memory: grows to the largest frame, never shrinks.
class HostOwnedStates {
 public:
  /// Call it before the first frame. Reserves for this many objects, with `state_bytes` bytes of model state each.
  void reserve(std::size_t objects, std::size_t state_bytes);

  /// Discards the states of two frames ago.
  void begin(std::uint64_t frame) noexcept;
  /// Adds one state of `frame`; `state` is the model's state.
  void add(std::uint64_t frame, const messages::ObjectRef& object, const Pose& pose, const std::byte* state);
  /// Call it after the last state of a frame, before the server is notified.
  void finish() const noexcept;

  std::span<const HostOwnedState> of(std::uint64_t frame) const noexcept { return editions_[frame & 1].objects.span(); }
  /// The model's state of the i-th object.
  const std::byte* state(std::uint64_t frame, std::size_t i) const noexcept {
    return editions_[frame & 1].states.data() + i * state_bytes_;
  }

 private:
  struct Edition {
    base::FlatList<HostOwnedState> objects;
    base::FlatList<std::byte> states;
  };
  Edition editions_[2];
  std::size_t state_bytes_ = 0;
};

}  // namespace ringfence::nodes
