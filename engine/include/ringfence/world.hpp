#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "ringfence/config.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/error.hpp"
#include "ringfence/fault.hpp"
#include "ringfence/frame_report.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/object.hpp"
#include "ringfence/object_contacts.hpp"
#include "ringfence/query_batch.hpp"
#include "ringfence/save.hpp"
#include "ringfence/seen_state.hpp"
#include "ringfence/shape.hpp"
#include "ringfence/snapshot.hpp"
#include "ringfence/status.hpp"

namespace ringfence {

/// Result of a call that spawns an object or connects a user node.
struct [[nodiscard]] Spawned {
  Status status = Status::ok;
  ObjectId id;  ///< null unless status is ok
};
struct [[nodiscard]] Connected {
  Status status = Status::ok;
  UserId user = no_user;
};

/// State of an object after the last frame.
struct ObjectView {
  ObjectId id;
  ObjectSpec spec;  ///< `pose` and `enabled` are the current ones
};

/// The collision service: a server, CD nodes and user nodes behind one object.
///
///   ringfence::WorldConfig config;
///   config.nodes = 4;
///   ringfence::World world(config);
///   auto ball = world.add_shape(ringfence::Sphere{1.0f});
///   auto user = world.connect().user;
///   auto me = world.spawn({.shape = ball, .category = ringfence::Category::avatar, .user = user}).id;
///   world.move(user, me, {{1, 2, 3}, {0, 0, 0, 1}});
///   world.advance();
///   for (const auto& contact : world.collisions_of(user)) respond(contact);
///
/// Threads: one thread at a time calls a World. Between begin_frame and finish_frame requests may be made (they belong
/// to the next frame) and the results of the frame before may be read. Failure: the constructor and add_shape throw
/// Error. Every other call returns a Status, counts refusals by reason in the next FrameReport, and leaves the state
/// unchanged when it refuses. Out of memory: the constructor, add_shape, objects(), snapshot() and
/// collisions_of(ObjectId) throw std::bad_alloc. Every other call returns Status::out_of_memory; finish_frame also
/// returns it when a thread of the World ran out of memory. From then on there are no more frames: every call that
/// returns a Status returns out_of_memory, and add_shape throws Error. The contacts of the last complete frame can
/// still be read; its report may be incomplete. The destructor works. Floating point: every call that computes, and
/// every thread of the World, uses the default floating-point environment, for motion models and support functions too.
/// The caller's modes (rounding, denormals, exceptions) are restored on return; status flags may be raised. Lifetime of
/// spans: until the next finish_frame or advance.
class World {
 public:
  explicit World(WorldConfig config);
  /// Restores a World from what save() wrote: it continues as the saved one would have, with the same contacts bit for
  /// bit. Shapes, objects, users, pending requests, ids and the frame number come from the save; nodes, deployment,
  /// placement, quotas and everything else come from `config`. Automatic bounds are chosen around the objects.
  ///
  /// Throws Error, which says what to do: for a save that is damaged, or of another format; if config.motion does not
  /// have the name and version of the saved model (MotionModel::name); if config.layers has names and differs from the
  /// saved layers (without names the saved layers are used); if a support function is missing in
  /// config.support_functions; and if the save exceeds config.limits.
  ///
  /// Before the first frame contacts(), object(), objects(), state() and snapshot() return the saved state; ended(),
  /// report(), collisions_of(UserId) and seen_by() are empty. refused(UserId) counts from there, and the history begins
  /// again.
  World(WorldConfig config, Source& source);
  /// Waits for a frame that is running, and ends the threads.
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  /// Moves the World with all its objects, also while a frame is running; spans, references and ids that it has
  /// returned stay valid. `other` may then only be destroyed or assigned to.
  World(World&& other) noexcept;
  /// The same; first ends this World, as its destructor does.
  World& operator=(World&& other) noexcept;

  const WorldConfig& config() const noexcept;

  /// Registers a shape for use by any number of objects. Throws Error with the reason. Not allowed while a frame is
  /// running.
  ShapeId add_shape(const ShapeDescription& description);
  /// Removes a shape and frees its memory, at the latest when the threads of lost CD nodes have ended. Its number is
  /// not used again. Refused: unknown_shape if it is not registered or was removed; shape_in_use while an object has it
  /// or a request for the next frame names it (a destroyed object has it until the frame that ends it is complete);
  /// out_of_order while a frame is running.
  Status remove_shape(ShapeId shape);

  /// Connects a user node from the next frame on. With `user` no_user the lowest free number is assigned.
  Connected connect(UserId user = no_user);
  /// Disconnects a user node at the next cut; its avatars are destroyed, and other hosts take over what else it hosts.
  Status disconnect(UserId user);

  /// Creates an object from the next frame on; the model's first move starts at `spec.pose`. Its id is valid at once,
  /// also for move, place and destroy.
  Spawned spawn(const ObjectSpec& spec);
  /// Destroys an object at the next cut; its contacts end in that frame.
  Status destroy(ObjectId object);
  /// As `destroy`, on behalf of a user node: refused (not_host) unless the object is an avatar of that user.
  Status destroy(UserId user, ObjectId object);

  /// Direct control by the user: in the next frame the avatar stands at `pose`, whatever the motion model computes.
  /// Refused (not_host) unless the object is an avatar of `user`. The last call before a frame counts.
  Status move(UserId user, ObjectId object, const Pose& pose);
  /// Passes what the user wants an avatar to do, such as keys or a direction, to the motion model: it receives `bytes`
  /// as MotionInput::input of that avatar in the next frame, and only in that one. So clients steer without setting the
  /// pose. The bytes are copied. The last call before a frame counts; an empty span withdraws the call before. Refused:
  /// not_host unless the object is an avatar of `user`; bad_message for more than max_input_bytes (32).
  Status input(UserId user, ObjectId object, std::span<const std::byte> bytes);
  /// Sets the pose of any object but a static one at the next cut (a teleport, a door, a lift); a disabled object
  /// becomes enabled. Its host continues from there. If the same frame also has a World::move of the object, that pose
  /// counts, whichever call came first.
  Status place(ObjectId object, const Pose& pose);
  /// Disables or enables an object, except a static one, at the next cut. A disabled object is in no contact, is seen
  /// by no user node, and keeps its pose and its model's state; its contacts end in that frame. `place` and `move`
  /// enable it too. Calls of World::move that precede a call with false do not count.
  Status set_enabled(ObjectId object, bool enabled);

  // Changes of an object, static ones too, at the next cut. They apply in the order of the calls. Contacts that the new
  // value does not allow end in that frame; those that it allows begin, and all others persist.
  /// Changes ObjectSpec::group.
  Status set_group(ObjectId object, std::uint32_t group);
  /// Changes ObjectSpec::layer. Refused with unknown_layer if it is not in WorldConfig::layers.
  Status set_layer(ObjectId object, std::uint8_t layer);
  /// Changes ObjectSpec::shape; pose and model state stay. Refused with unknown_shape if it is not registered.
  Status set_shape(ObjectId object, ShapeId shape);
  /// Replaces the motion model's state of an object: the model receives it in the next frame as part of S(k-1). `bytes`
  /// are copied. Refused: bad_message unless they are exactly MotionModel::state_bytes() (0 without a model);
  /// bad_category for a static object, which no model moves.
  Status set_state(ObjectId object, std::span<const std::byte> bytes);

  /// Changes the number of CD nodes. New nodes join in the next frame; at its end regions and hosted objects are handed
  /// over, and the nodes that leave are removed. No frame is lost and no contact changes. The last call before a frame
  /// counts. Creates the threads of the new nodes; if the system has none, the call is refused with no_thread, a log
  /// line says what to do, and the number of nodes stays. Refused with bad_number unless `nodes` is 1 to 1024 and at
  /// most the number of cells; with remote nodes, which join on their own, also if it exceeds the current number.
  Status resize(std::uint32_t nodes);
  /// CD nodes that took part in the last frame; before the first frame, the current number.
  std::uint32_t nodes() const noexcept;
  /// The CD node in whose region a position lies, by the region map of the next frame.
  /// Empty while a frame is running. Precondition: finite.
  std::optional<NodeId> node_at(const Vec3d& position) const noexcept;

  /// Makes a CD node or a user node stop at a point of a future frame, to test failover. Without
  /// WorldConfig::deadlines that frame waits until release_faults() is called, and a user node that stops delays all
  /// user nodes of its thread. The last call for a role counts. Refused with bad_number for a frame that has begun, an
  /// unknown node or user node, a late user node, a stall that is negative or not finite, a stage that the role does
  /// not have, a remote node, and with nodes = 0.
  Status inject(const Fault& fault);
  /// Makes the creation of one thread fail after `succeed_first` successful ones, to test a system without free
  /// threads.
  void fail_thread_creation(std::uint32_t succeed_first = 0) noexcept;
  /// Releases all roles that injected faults have stopped, and cancels the faults that have not stopped a role yet.
  /// Returns how many roles were stopped within a step. Allowed while a frame is running. The destructor calls it.
  std::uint32_t release_faults() noexcept;

  /// Runs a whole frame: begin_frame and finish_frame.
  Status advance();
  /// Starts a frame and returns; with nodes = 0 the work is done in finish_frame.
  Status begin_frame();
  /// Waits until the frame is complete: all contacts are found and all hosts notified.
  Status finish_frame();

  /// Number of completed frames.
  std::uint64_t frames() const noexcept;

  /// All begin and persist contacts of the last frame, in order of (a, b).
  std::span<const Contact> contacts() const noexcept;
  /// All contacts that ended in the last frame, in order of (a, b).
  std::span<const Contact> ended() const noexcept;
  /// Contacts that the user node received (M4): those of the objects that it hosts, ended ones too, in order of (a, b).
  /// Empty if it was late in the last frame (FrameReport::late) or is not connected.
  std::span<const Contact> collisions_of(UserId user) const noexcept;
  /// Number of calls on behalf of a user (spawn, destroy, move, input), and of records and messages of its user node,
  /// that were refused since it connected, by its quotas or otherwise. Those of the user node count from the frame
  /// after. 0 if it is not connected, or if a frame is running.
  std::uint64_t refused(UserId user) const noexcept;
  /// Begin and persist contacts of one object, in order of (a, b). The first call after a frame builds an index.
  ObjectContacts collisions_of(ObjectId object) const;
  /// States of other objects near the user node's avatars in the last frame, as spans of the publications: all objects
  /// within WorldConfig::interest of an avatar, and some that are farther away; which ones depends on the number of
  /// nodes. So compare distances where that matters. Static objects are not included. Empty if the user node was late
  /// in the last frame or is not connected, and after a call returned out_of_memory.
  std::span<const std::span<const SeenState>> seen_by(UserId user) const noexcept;

  /// The last complete frame, pinned for queries about its objects: rays, sweeps, overlaps, nearest. Empty before the
  /// first frame is complete. While a frame is running: the frame before, if a snapshot of it was taken before
  /// begin_frame; otherwise empty. The first call after a frame copies what queries read of each object and builds an
  /// index; further calls share it. Without a call nothing is recorded.
  Snapshot snapshot() const;

  /// The CD nodes answer the queries of the batch in the next frame, in parallel; finish_frame completes its answers.
  /// See QueryBatch. Several batches may be attached; each for one frame, so attach it again for the one after. Refused
  /// with out_of_order while a frame is running, and if the batch is attached already. Frames without a batch pay
  /// nothing.
  Status attach(QueryBatch& batch);

  /// The object as it stood after the last frame; `id` is null if the id is stale, the object not yet in the world, or
  /// a frame is running.
  ObjectView object(ObjectId object) const noexcept;
  /// The motion model's state of the object after the last frame: MotionModel::state_bytes() bytes, valid until the
  /// next begin_frame. Empty where object() returns a null id, and without a model.
  std::span<const std::byte> state(ObjectId object) const noexcept;
  /// All objects of the world, in order of number; empty while a frame is running. Copies, meant for checks, saves and
  /// debugging.
  std::vector<ObjectView> objects() const;
  /// Id of the live object with that number; null if there is none.
  ObjectId find(ObjectNumber number) const noexcept;
  /// The description of a registered shape. Precondition: has_shape(shape). Valid until the shape is removed.
  const ShapeDescription& shape(ShapeId shape) const noexcept;
  /// Whether the shape was registered and not removed.
  bool has_shape(ShapeId shape) const noexcept;
  /// Number of shapes that were registered, removed ones too: one more than the number of the last.
  std::size_t shape_count() const noexcept;

  /// Results and cost of the last frame.
  const FrameReport& report() const noexcept;

  /// Writes everything that determines the future of the World, and `own`, bytes of the caller's such as a digest. The
  /// World with the same frames, calls and layers writes the same bytes in every deployment. Attached batches, injected
  /// faults and the history are not saved. docs/saving.md has the costs.
  ///
  /// Refused: out_of_order while a frame is running; not_written if the sink returned false; bad_shape if a support
  /// function has no name. A World with a motion model without a name is saved, and matches any model without a name.
  Status save(Sink& sink, std::span<const std::byte> own = {});
  /// Makes the calls of a recorded frame again, so that advance() runs the same frame: `inputs` are those that
  /// Recorder::begin_frame received in the World that was saved, for the frame with the number frames(). An embedder
  /// makes no other requests. Refused: out_of_order while a frame is running; bad_message if they do not fit this
  /// World: then it must not run another frame.
  Status apply(std::span<const std::byte> inputs);
  /// The caller's bytes of the save from which this World was restored; otherwise empty. Valid as long as the World.
  std::span<const std::byte> saved_bytes() const noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence
