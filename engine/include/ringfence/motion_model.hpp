#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "ringfence/ids.hpp"
#include "ringfence/object.hpp"
#include "ringfence/object_contacts.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/senses.hpp"

namespace ringfence {

/// Largest input of an object for one frame, bytes; see World::input.
inline constexpr std::size_t max_input_bytes = 32;

/// One hosted object as the model receives it. All fields are the same in every deployment.
struct MotionInput {
  ObjectNumber number = 0;
  ShapeId shape;
  Category category = Category::active;
  bool enabled = true;  ///< false: in no contact, and no user node sees it
  std::uint64_t user_data = 0;
  Pose pose;                         ///< S(k-1)
  const std::byte* state = nullptr;  ///< the model's own part of S(k-1): state_bytes() of plain data, 8-byte aligned
  ObjectContacts contacts;           ///< begin and persist contacts of C(k-1), if the model uses_contacts()
  std::span<const std::byte> input;  ///< of World::input for this frame; empty if there is none; lives during the call
  const Senses* senses = nullptr;    ///< queries about frame k-1 around the object; null if WorldConfig::sense is 0
};

/// The model's result for one object. Initialised to "does not move": pose, enabled and state unchanged, no jump.
struct MotionOutput {
  Pose pose;  ///< finite, orientation within 10^-3 of unit length; otherwise refused and the object does not move
  bool enabled = true;
  std::byte* state = nullptr;  ///< state_bytes() bytes, to be overwritten
  /// The object is placed at `pose`: it does not move there from its pose before. Contacts do not depend on it: they
  /// are those of the poses at the end of the frame. For tests along the way between two frames, which do not exist
  /// yet.
  bool jump = false;
};

/// Moves hosted objects and responds to their contacts. Supplied by the embedder; examples are the paper's steering and
/// the replay of recordings.
///
/// `move` computes S(k) from the frame number, the object's number, its S(k-1), its C(k-1), its input for frame k and
/// what it senses of frame k-1, and from nothing else that can differ between calls. This makes all deployments compute
/// the same states. It is called in batches, concurrently, by all threads that host objects, for avatars too (an
/// explicit World::move replaces the avatar's pose for that frame).
///
/// An exception is caught: the objects for which the model throws do not move in that frame and are reported. The model
/// must not call World.
class MotionModel {
 public:
  virtual ~MotionModel() = default;

  /// Name and version by which a save refers to the model: the World that is restored must have a model with the same
  /// name and version. Change the version whenever `move` would compute other states, also from other parameters or
  /// recorded data. Constant over the model's life.
  virtual std::string_view name() const noexcept { return {}; }
  virtual std::uint64_t version() const noexcept { return 0; }

  /// Bytes of plain data that the model keeps per object: at most max_motion_state. Constant over the model's life.
  virtual std::size_t state_bytes() const noexcept { return 0; }

  /// Initialises the state of a new object (zeroed before), once, at spawn. Must be pure, like `move`.
  virtual void start(const ObjectSpec& spec, std::byte* state) const {
    (void)spec;
    (void)state;
  }

  /// Whether `move` reads contacts. If false, contacts are not gathered by object, which saves 5 % of a frame, and
  /// `contacts` of every input is empty. Constant over the model's life.
  virtual bool uses_contacts() const noexcept { return true; }

  /// Moves a batch of up to 64 objects in frame `frame`. `inputs` and `outputs` have equal size and order.
  virtual void move(std::uint64_t frame, std::span<const MotionInput> inputs,
                    std::span<MotionOutput> outputs) const = 0;
};

/// Largest state that a motion model may keep per object, bytes.
inline constexpr std::size_t max_motion_state = 256;

}  // namespace ringfence
