#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "messages/run.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/host/host.hpp"
#include "nodes/move_watch.hpp"
#include "nodes/role.hpp"
#include "ringfence/config.hpp"
#include "telemetry/step_clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

/// What a thread provides for the user nodes that it steps. Each may be null.
struct UserThreadParts {
  telemetry::Track* track = nullptr;      ///< null: no timeline
  telemetry::StepClock* clock = nullptr;  ///< null: not measured
  MoveWatch* watch = nullptr;             ///< null: no deadline
};

/// Configuration of a user node. The pointers outlive the role.
struct UserSetup {
  UserNumber user = 0;
  const MotionModel* model = nullptr;
  Publications* publications = nullptr;
  double interest = 0;  ///< metres; 0: does not read the states of others
  UserThreadParts thread;
  std::size_t objects = 0;         ///< number to reserve for
  FaultRelease* faults = nullptr;  ///< ends an injected stop; null: the role does not stop
  Connection server;
};

/// A user node: hosts its avatars, and in user deployment its share of all other objects. It moves them, sends their
/// states to the server (M1) and to the other users (its publication), reads the publications of others near its
/// avatars after the server has allowed it, and receives the contacts of its objects (M4). It is connected to the
/// server only.
///
/// Threads: one thread at a time steps it. Never throws; does not allocate in steady state. Blocks only while the
/// motion model does not return.
class UserRole {
 public:
  explicit UserRole(const UserSetup& setup);
  UserRole(const UserRole&) = delete;
  UserRole& operator=(const UserRole&) = delete;

  Step step();

  /// Another thread steps the role from now on.
  void set_thread(const UserThreadParts& thread) noexcept { setup_.thread = thread; }

  /// Sets the pose of an avatar in the next frame, whatever the model computes. Between frames, for the facade.
  void steer(ObjectNumber number, const Pose& pose) { steered_.push_back({number, pose}); }

  /// Injects a fault before its motion model or its publication. Between frames, while no thread steps the role; the
  /// last call counts.
  void fail(const Fault& fault) noexcept { fault_.set(fault); }

  /// Contacts that the node received in that frame (M4), in order of (a, b), ended ones too.
  std::span<const Contact> contacts(std::uint64_t frame) const noexcept { return host_.contacts(frame); }
  /// States of others near its avatars in that frame, as spans of their publications.
  std::span<const std::span<const link::PublishedState>> seen(std::uint64_t frame) const noexcept {
    return seen_[frame & 1];
  }
  const Host& host() const noexcept { return host_; }
  /// Records of its own messages that the server has refused so far; 0 unless another sender uses its endpoint.
  std::uint64_t refused() const noexcept { return refused_; }

 private:
  enum class Stage : std::uint8_t { waiting, sending_states, reading_others, awaiting_contacts, finishing, abandoned };
  struct Steered {
    ObjectNumber number;
    Pose pose;
  };

  void receive(const messages::MessageView& message);
  void receive_contacts(const messages::MessageView& message);
  void begin(std::uint64_t frame);
  bool move();
  void move_and_publish();
  void read_others();
  void read_box(const Published& published, const regions::CellBox& box, std::size_t earlier);
  void read_rows(const Published& published, const regions::CellBox& box);
  void read_cells(const Published& published, const regions::CellBox& box, std::size_t earlier);
  void enter(telemetry::StepClock::Step step) noexcept;
  bool advance();
  bool send_states();
  bool send_frame_done();

  UserSetup setup_;
  messages::Endpoint self_;
  FaultPoint fault_;
  Host host_;
  Published published_;  ///< of this frame; other roles read a copy
  Stage stage_ = Stage::waiting;
  std::uint64_t frame_ = 0;
  bool may_read_ = false;  ///< read_publications has arrived
  bool contacts_received_ = false;
  std::uint64_t refused_ = 0;
  std::vector<Steered> steered_;  ///< for the next frame
  std::vector<std::span<const link::PublishedState>> seen_[2];
  std::vector<regions::CellBox> boxes_;  ///< around the avatars
  messages::RunSender states_run_, frame_done_run_;
  messages::TrafficCounts traffic_{};
  messages::NodeFrameStats frame_stats_;
};

}  // namespace ringfence::nodes
