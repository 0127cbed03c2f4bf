#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "ringfence/config.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/error.hpp"
#include "ringfence/fault.hpp"
#include "ringfence/frame_report.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/object.hpp"
#include "ringfence/seen_state.hpp"
#include "ringfence/shape.hpp"
#include "ringfence/status.hpp"

namespace ringfence {

/// What a call answers that makes an object or connects a user node.
struct Spawned {
  Status status = Status::ok;
  ObjectId id;  ///< null unless status is ok
};
struct Connected {
  Status status = Status::ok;
  UserNumber user = no_user;
};

/// An object as it stands after the last frame.
struct ObjectView {
  ObjectId id;
  ObjectSpec spec;  ///< `pose` and `present` are the current ones
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
/// to the next frame) and the results of the frame before may be read.
/// Failure: the constructor and add_shape throw Error; everything else answers a Status, counts what it refuses by
/// reason in the next FrameReport, and leaves the state as it was.
/// Lifetime of spans: until the next finish_frame or advance.
class World {
 public:
  explicit World(WorldConfig config);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  const WorldConfig& config() const noexcept;

  /// Prepares a shape for use by any number of objects. Throws Error with the reason. Not while a frame is under way.
  ShapeNumber add_shape(const ShapeDescription& description);

  /// Connects a user node from the next frame on. `user` no_user: the lowest free number is given.
  Connected connect(UserNumber user = no_user);
  /// Disconnects it at the next frame's cut; its avatars are destroyed, what else it hosts goes to other hosts.
  Status disconnect(UserNumber user);

  /// Makes an object from the next frame on: the model's first move takes it from `spec.pose` there. Its id is valid at
  /// once, for move, place and destroy too.
  Spawned spawn(const ObjectSpec& spec);
  /// Ends an object at the next frame's cut; its contacts end in that frame.
  Status destroy(ObjectId object);
  /// As `destroy`, on behalf of a user node: refused (not_host) unless the object is an avatar of that user.
  Status destroy(UserNumber user, ObjectId object);

  /// The user's direct control: in the next frame the avatar stands at `pose`, whatever the motion model says.
  /// Refused (not_host) unless the object is an avatar of `user`. The last call before a frame counts.
  Status move(UserNumber user, ObjectId object, const Pose& pose);
  /// Puts any object but a static one somewhere at the next frame's cut (a teleport, a door, a lift); an absent object
  /// is present from then on. Its host goes on from there; where the same frame also has a World::move of it, whichever
  /// call came first, it stands where it was moved.
  Status place(ObjectId object, const Pose& pose);
  /// Takes the object out of the world's contacts, from the next frame until it is placed or moved again.
  Status remove(ObjectId object);

  /// Changes the number of CD nodes: those to come join the next frame, and at its end regions, hosted objects and
  /// duties are handed over; those to go then leave. No frame is lost and no contact changes. The last call before a
  /// frame counts. Refused with bad_number unless `nodes` is 1 to 1024 and at most the number of cells; with a fleet,
  /// whose nodes join by themselves, also where it is more than there are.
  Status resize(std::uint32_t nodes);
  /// CD nodes at work in the last frame; before the first, those that there are.
  std::uint32_t nodes() const noexcept;

  /// Makes a CD node fail at a point of a frame to come, as a test of what follows. Without WorldConfig::deadlines the
  /// frame would wait for ever. Refused with bad_number for a frame that has begun, a node that there is not, a stall
  /// that is negative or not finite, a node of a fleet, and with nodes = 0.
  Status inject(const Fault& fault);

  /// A whole frame: begin_frame and finish_frame.
  Status advance();
  /// Starts a frame and returns; with nodes = 0 the work is done in finish_frame.
  Status begin_frame();
  /// Waits for the frame to be complete: every contact found, every host told.
  Status finish_frame();

  /// Frames completed.
  std::uint64_t frames() const noexcept;

  /// All begin and persist contacts of the last frame, in order of (a, b).
  std::span<const Contact> contacts() const noexcept;
  /// All contacts that ended in the last frame, in order of (a, b).
  std::span<const Contact> ended() const noexcept;
  /// What the user node was told (M4): contacts of the objects that it hosts, ended ones too, in order of (a, b).
  std::span<const Contact> collisions_of(UserNumber user) const noexcept;
  /// Begin and persist contacts of one object, in order of (a, b). Builds an index at the first call after a frame.
  ObjectContacts collisions_of(ObjectId object) const;
  /// The states of others near the user node's avatars in the last frame, in place, as runs of what was published:
  /// all that stand within WorldConfig::interest of an avatar, and others in the same cells. Static objects are not
  /// among them.
  std::span<const std::span<const SeenState>> seen_by(UserNumber user) const noexcept;

  /// The object as it stood after the last frame; `id` is null if it is stale, not yet in the world, or a frame is
  /// under way.
  ObjectView object(ObjectId object) const noexcept;
  /// Every object in the world, in order of number; empty while a frame is under way. Copies: meant for checks, saves
  /// and debugging.
  std::vector<ObjectView> objects() const;
  /// The live object with that number; null if there is none.
  ObjectId find(ObjectNumber number) const noexcept;
  /// A registered shape as it was described. Precondition: shape < shape_count().
  const ShapeDescription& shape(ShapeNumber shape) const noexcept;
  std::size_t shape_count() const noexcept;

  /// What the last frame did and cost.
  const FrameReport& report() const noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence
