#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/flat_list.hpp"
#include "messages/records.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::nodes {

/// S(k) of an object, without the model's part: a cache line.
struct alignas(64) HostOwnedState {
  messages::ObjectRef object;
  Pose pose;
};
static_assert(sizeof(HostOwnedState) == 64);

/// The states that a CD node that may be lost moves and does not tell the server, which need not know of them: left
/// where it can read them, in memory that both share, in place of messages `node_state`.
///
/// It reads them when the node is lost, and only then: of a node that answers it reads the Host. Two frames are kept,
/// by parity: S(k - 1) stays as it is while S(k) is moved, also by a node that is late rather than dead. Written past
/// the caches where the processor can: as a rule nobody reads them.
///
/// Threads: one writer; the server reads the last frame from when the node has told that it has moved all until the
/// next begins, and the frame before at any time in a frame. Memory: grows to what is kept, never shrinks.
class HostOwnedStates {
 public:
  /// Before the first frame: for so many objects with so many bytes of the model's part each.
  void reserve(std::size_t objects, std::size_t state_bytes);

  /// Forgets what was kept two frames ago.
  void begin(std::uint64_t frame) noexcept;
  /// One more of `frame`; `state` is the model's part.
  void add(std::uint64_t frame, const messages::ObjectRef& object, const Pose& pose, const std::byte* state);
  /// After the last of a frame, before others are told of it.
  void finish() const noexcept;

  std::span<const HostOwnedState> of(std::uint64_t frame) const noexcept { return editions_[frame & 1].objects.span(); }
  /// The model's part of the i-th of these.
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
