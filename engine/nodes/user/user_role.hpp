#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "messages/run.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/host/host.hpp"
#include "nodes/move_watch.hpp"
#include "nodes/role.hpp"
#include "nodes/user/interest_reader.hpp"
#include "ringfence/config.hpp"
#include "telemetry/step_clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

/// What a thread provides for the user nodes that it steps. Each pointer may be null.
struct UserThreadParts {
  telemetry::Track* track = nullptr;      ///< null: no timeline
  telemetry::StepClock* clock = nullptr;  ///< null: not measured
  MoveWatch* watch = nullptr;             ///< null: the World does not abandon the thread
};

/// Configuration of a user node. What the pointers refer to outlives the role.
struct UserSetup {
  UserNumber user = 0;
  const MotionModel* model = nullptr;
  Publications* publications = nullptr;
  double interest = 0;  ///< metres; 0: the node does not read the states of others
  double sense = 0;     ///< WorldConfig::sense, metres
  UserThreadParts thread;
  std::size_t objects = 0;         ///< number of objects to reserve for
  FaultRelease* faults = nullptr;  ///< ends an injected stop; null: the role does not stop
  link::Sender* server = nullptr;  ///< to the server; all user nodes of a thread have the same
};

/// A user node. It hosts its avatars, and in user deployment also its share of the active and non-active objects.
///
/// In each frame it moves its objects, sends their states to the server (M1) and publishes them for the other user
/// nodes. It reads the publications of others near its avatars when the server has allowed this. Then it receives the
/// contacts of its objects (M4). It is connected to the server only, by the connection of its thread: UserThreadRole
/// receives the messages and passes them to it.
///
/// Threads: one thread at a time steps it. Throws only std::bad_alloc, and allocates nothing in steady state. Blocks
/// only while the motion model does not return or an injected fault stops it.
class UserRole {
 public:
  explicit UserRole(const UserSetup& setup);
  UserRole(const UserRole&) = delete;
  UserRole& operator=(const UserRole&) = delete;

  // Each of the following returns Step::idle if the node waits for the next message, Step::blocked if it waits for room
  // in the ring, or Step::abandoned.
  /// frame_begin has arrived: moves its objects, publishes them, and sends their states.
  Step begin(std::uint64_t frame);
  /// read_publications has arrived.
  Step allow_reading();
  /// Another message of the server has arrived.
  Step receive(const messages::MessageView& message);
  /// Continues the frame as far as possible. Call it after Step::blocked.
  Step resume();

  /// Prefetches what begin(), or the other steps, access in the object itself.
  void prefetch(bool begins) const noexcept;
  /// Prefetches the arrays that begin(), or allow_reading(), accesses. Reads what prefetch() loads.
  void prefetch_arrays(bool begins) const noexcept;
  /// Prefetches what begin() writes into the publication. Reads what prefetch_arrays() loads.
  void prefetch_publication() const noexcept {
    if (published_.publication != nullptr) {  // it has moved before
      published_.publication->prefetch_arrays();
    }
  }

  UserNumber number() const noexcept { return setup_.user; }
  /// Size of a model state in messages.
  std::size_t state_bytes() const noexcept { return host_.state_bytes(); }
  /// Call it when another thread steps the role from now on, while no thread steps it.
  void set_thread(const UserThreadParts& thread) noexcept { setup_.thread = thread; }

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
  /// States of others near its avatars in that frame, as spans of their publications. Valid until frame + 2 begins, if
  /// the publications still exist.
  std::span<const std::span<const link::PublishedState>> seen(std::uint64_t frame) const noexcept {
    return reader_.seen(frame);
  }
  const Host& host() const noexcept { return host_; }
  /// Number of its records and messages that the server has refused and reported so far. 0 unless the user exceeds a
  /// quota, or another sender uses its endpoint.
  std::uint64_t refused() const noexcept { return refused_; }

 private:
  enum class Stage : std::uint8_t { waiting, sending_states, reading_others, awaiting_contacts, finishing, abandoned };
  void receive_contacts(const messages::MessageView& message);
  bool move();
  void move_and_publish();
  void enter(telemetry::StepClock::Step step) noexcept;
  bool advance();
  bool send_states();
  bool send_frame_done();

  UserSetup setup_;
  messages::Endpoint self_;
  FaultPoint fault_;
  Host host_;
  Published published_;  ///< of this frame; other roles read the copy in Publications
  Stage stage_ = Stage::waiting;
  std::uint64_t frame_ = 0;
  bool may_read_ = false;  ///< read_publications has arrived, or there is no interest
  bool contacts_received_ = false;
  std::uint64_t refused_ = 0;
  InterestReader reader_;
  messages::RunSender states_run_, frame_done_run_;
  std::uint64_t published_states_ = 0;  ///< number in this frame
};

}  // namespace ringfence::nodes
