#pragma once

#include <cstdint>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

#include "facade/cd_nodes/cd_nodes.hpp"
#include "facade/cd_nodes/node_membership.hpp"
#include "facade/queries/attached_batches.hpp"
#include "facade/queries/frame_store.hpp"
#include "facade/queries/sensed_frames.hpp"
#include "facade/requests/requests.hpp"
#include "facade/results/contact_index.hpp"
#include "facade/save/recorded_inputs.hpp"
#include "facade/save/saved_world.hpp"
#include "facade/users/user_nodes.hpp"
#include "facade/world_state.hpp"
#include "nodes/server/server_role.hpp"
#include "ringfence/world.hpp"

namespace ringfence {

/// The parts of a World, and the steps of a frame in which several of them take part. World::begin_frame and
/// World::finish_frame (world.cpp) call these steps and those of the parts, one after another.
///
/// Threads: used by the thread that calls World. If roles have threads of their own, that thread accesses a role only
/// while no frame is running, or after it has taken the role from its thread.
struct World::Implementation {
  /// Throws Error if the configuration is invalid or the system lacks what it requires.
  explicit Implementation(WorldConfig given) : Implementation(std::move(given), 0) {}
  /// The World that `saved` continues in. Throws Error also if the save does not fit together.
  Implementation(WorldConfig given, const facade::SavedWorld& saved);

  bool frame_is_running() const noexcept { return begun != frames; }
  /// Result of `call`, which returns a Status or a struct with one; out_of_memory if memory has run out in it or
  /// before.
  template <class Call>
  auto answer(Call call);
  /// Injects a fault into the role that it names. Returns false if it is invalid, or the role is unknown or does not
  /// have the stage.
  bool inject(const Fault& fault);
  /// The user node whose results of the last frame can be read; null if it is not connected or late, or before the
  /// first frame.
  const nodes::UserRole* reader(UserId user) const noexcept;
  /// The slot of a live object that is in the world, or base::NumberIndex::none; none while a frame is running.
  std::uint32_t slot_of(ObjectId object) const noexcept;

  // The steps of a frame, in order.
  /// Lets the server begin the next frame.
  void order_frame();
  /// Waits until the frame that is running is complete, or steps all roles until then. Meanwhile replaces the last CD
  /// node and threads of user nodes if the server asks for it. Returns false if memory ran out.
  bool await_frame();
  /// Takes the report of the last frame from the server, with the numbers of refused calls.
  void take_report();
  /// Adds to the report what roles other than the server measured.
  void complete_report();
  /// Frees the roles that are gone, unless their threads still run, and removes the nodes that the frame lost.
  void free_gone_roles();
  /// Logs what the report has about losses and failures.
  void log_frame();
  /// Call it when memory has run out: no further frame runs. Returns Status::out_of_memory.
  Status stop_frames() noexcept;

  // Members are destroyed from the last to the first. All threads end first (`stop`), because they use the roles, the
  // channels and each other's doorbells. Then the server is freed, then the CD nodes and the user nodes, each with its
  // channels, and at last what all of them refer to (`state`).
  facade::WorldState state;
  facade::Requests requests;
  std::uint64_t begun;                 ///< number of frames begun
  std::uint64_t frames;                ///< number of frames completed
  FrameReport report;                  ///< of the last frame
  facade::ShapeChanges shape_changes;  ///< if there is a recorder
  bool unrecorded = false;             ///< a frame could not be recorded: no further frame runs
  std::vector<std::byte> own;          ///< the caller's bytes of the save
  mutable facade::ContactIndex contact_index;
  mutable facade::FrameStore frame_store;  ///< of snapshots
  facade::SensedFrames sensed_frames;
  facade::AttachedBatches batches;  ///< of the next frame, or of the one that is running
  facade::UserNodes users;
  facade::CdNodes nodes;
  facade::NodeMembership membership;
  std::unique_ptr<nodes::ServerRole> server;

  Implementation(WorldConfig given, std::uint64_t first_frame);
  /// Registers a shape here and on remote nodes; see World::add_shape.
  ShapeNumber add_shape(const ShapeDescription& description);
  void remove_shape(ShapeNumber shape);
  void restore_shapes(const facade::SavedWorld& saved);
  /// World::apply. Throws Error if the inputs do not fit.
  void apply(const facade::RecordedInputs& inputs);
  // Tell the recorder of the frame that begins, and of the one that is complete. Return false if no frame may follow.
  bool record(World& world);
  bool acknowledge(World& world);

  struct ThreadStopper {
    Implementation& world;
    ~ThreadStopper();
  } stop{*this};
};

template <class Call>
auto World::Implementation::answer(Call call) {
  using Answer = std::invoke_result_t<Call>;
  const auto refusal = [](Status status) {
    if constexpr (std::is_same_v<Answer, Status>) {
      return status;
    } else {
      Answer answer;
      answer.status = status;
      return answer;
    }
  };
  try {
    return state.halt.is_set() ? refusal(Status::out_of_memory) : call();
  } catch (const std::bad_alloc&) {
    return refusal(stop_frames());
  }
}

}  // namespace ringfence
