#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/numbers.hpp"
#include "messages/run.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/host/host.hpp"
#include "nodes/user/interest_reader.hpp"

namespace ringfence::nodes {

/// Configuration of a user node. What the pointers refer to outlives the role.
struct UserSetup {
  UserNumber user = 0;
  const MotionModel* model = nullptr;
  double sense = 0;                ///< WorldConfig::sense, metres
  std::size_t objects = 0;         ///< number of objects to reserve for
  FaultRelease* faults = nullptr;  ///< ends an injected stop; null: the role does not stop
};

/// A user node. It hosts its avatars, and in user deployment also its share of the active and non-active objects.
///
/// UserThreadRole calls the steps of its frame: it moves its objects, sends their states to the server (M1) and adds
/// them to the publication of its thread. It reads the publications near its avatars when the server has allowed this,
/// and receives the contacts of its objects (M4).
///
/// Threads: one thread at a time steps it. Throws only std::bad_alloc, and allocates nothing in steady state. Blocks
/// only while the motion model does not return or an injected fault stops it. Memory: starts at a cache line, so that
/// the roles of many users, which are made one after another, are at one distance from each other. With 65,536 users
/// they were not in the first world of a process, and a frame took twice as long on the user thread.
class alignas(64) UserRole {
 public:
  explicit UserRole(const UserSetup& setup);
  UserRole(const UserRole&) = delete;
  UserRole& operator=(const UserRole&) = delete;

  // The steps of a frame, in order; `scratch` is that of the thread.
  /// Computes S(frame).
  void move(std::uint64_t frame, MoveScratch& scratch, const queries::RecordedFrame* sensed);
  /// Adds the objects to what the thread publishes. Returns the number of those that have a state.
  std::uint32_t publish(UserStates& states);
  /// Number of states that send_states() sends; valid, like these, until another user node of the thread moves.
  std::size_t changed() const noexcept { return host_.changed().size(); }
  /// Sends the states that changed. Returns false if it has to be called again because the ring is full.
  bool send_states(link::Sender& server, messages::RunSender& run) const;
  /// Reads what others have published.
  void read(InterestReader& reader) { seen_[reader.frame() & 1] = reader.read(host_, own_); }
  /// A message of the server to this user node has arrived. `between_frames`: outside of a frame, so contacts are those
  /// of the frame before, for objects that the node has adopted since.
  void receive(const messages::MessageView& message, bool between_frames);

  /// Prefetches what move() accesses in the object itself, and then the arrays to which it refers.
  void prefetch_move() const noexcept;
  void prefetch_arrays() const noexcept { host_.prefetch_move(); }
  /// The same for read().
  void prefetch_read() const noexcept;
  void prefetch_avatar() const noexcept { host_.prefetch_first(); }

  UserNumber number() const noexcept { return user_; }
  /// Size of a model state in messages.
  std::size_t state_bytes() const noexcept { return host_.state_bytes(); }

  /// Sets the pose of an avatar in the next frame, whatever the model computes. The facade calls it between frames.
  void steer(ObjectNumber number, const Pose& pose) { host_.steer(number, pose); }

  /// Passes an input of an avatar to the motion model in the next frame; the last input of an avatar counts. The facade
  /// calls it between frames.
  void give_input(const ObjectInput& input) { host_.give_input(input); }

  /// Injects a fault: the role stops before it calls the motion model, or before it publishes. Call it between frames,
  /// while no thread steps the role. The last call counts.
  void fail(const Fault& fault) noexcept { fault_.set(fault); }

  /// Contacts that the node received in that frame (M4), in order of (a, b), including the ended ones. Valid until
  /// frame + 2 begins.
  std::span<const Contact> contacts(std::uint64_t frame) const noexcept { return host_.contacts().received(frame); }
  /// States of others near its avatars in that frame, as spans of their publications. Valid until frame + 2 begins.
  std::span<const std::span<const PublishedState>> seen(std::uint64_t frame) const noexcept {
    return seen_[frame & 1].spans();
  }
  const Host& host() const noexcept { return host_; }
  /// Number of its records and messages that the server has refused and reported so far. 0 unless the user exceeds a
  /// quota, or another sender uses its endpoint.
  std::uint64_t refused() const noexcept { return refused_; }

 private:
  UserNumber user_;
  OwnStates own_;     ///< of this frame
  SeenPart seen_[2];  ///< by parity of the frame
  Host host_;
  std::uint64_t refused_ = 0;
  FaultPoint fault_;
};

}  // namespace ringfence::nodes
