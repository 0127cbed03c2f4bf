#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "ringfence/contact.hpp"
#include "ringfence/object.hpp"

namespace ringfence {

/// The contacts of one object in the frame before, begin and persist ones, in order of (a, b).
class ObjectContacts {
 public:
  ObjectContacts() = default;
  ObjectContacts(const Contact* all, std::span<const std::uint32_t> indices) noexcept : all_(all), indices_(indices) {}
  std::size_t size() const noexcept { return indices_.size(); }
  bool empty() const noexcept { return indices_.empty(); }
  const Contact& operator[](std::size_t i) const noexcept { return all_[indices_[i]]; }

 private:
  const Contact* all_ = nullptr;
  std::span<const std::uint32_t> indices_;
};

/// One hosted object as the model is given it. Everything here is the same in every deployment.
struct MotionInput {
  ObjectNumber number = 0;
  ShapeNumber shape = 0;
  Category category = Category::active;
  bool present = true;
  std::uint64_t user_data = 0;
  Pose pose;                         ///< S(k-1)
  const std::byte* state = nullptr;  ///< the model's own part of S(k-1): state_bytes() of plain data, 8-byte aligned
  ObjectContacts contacts;           ///< C(k-1), if the model uses_contacts()
};

/// What the model answers. Filled beforehand with "stands still": pose, presence and state as they were.
struct MotionOutput {
  Pose pose;  ///< finite, orientation within 10^-3 of unit; otherwise refused, and the object stands still
  bool present = true;
  std::byte* state = nullptr;  ///< state_bytes() to overwrite
};

/// What moves hosted objects and answers their contacts. The embedder supplies it; the paper's steering and replay
/// are two of them.
///
/// `move` computes S(k) from the frame number, the object's number, its S(k-1) and its C(k-1), and from nothing else
/// that can differ between calls: that is what makes the deployments agree. It is called on batches, concurrently, by
/// whichever threads host the objects; avatars too (an explicit World::move replaces its pose for that frame).
///
/// An exception is caught: the objects for which the model throws stand still that frame and are reported.
/// It must not call World.
class MotionModel {
 public:
  virtual ~MotionModel() = default;

  /// Plain data that the model keeps for each object: at most max_motion_state. Constant over the model's life.
  virtual std::size_t state_bytes() const noexcept { return 0; }

  /// Fills the state of a new object (zeroed beforehand), once, at spawn. Pure, like `move`.
  virtual void start(const ObjectSpec& spec, std::byte* state) const {
    (void)spec;
    (void)state;
  }

  /// Whether `move` looks at the contacts that it is given. If not, nobody gathers them by object, which takes a
  /// twentieth of a frame, and `contacts` of every input is empty. Constant over the model's life.
  virtual bool uses_contacts() const noexcept { return true; }

  /// Moves a batch for frame `frame`. `inputs` and `outputs` have equal size and order; up to 64 at a time.
  virtual void move(std::uint64_t frame, std::span<const MotionInput> inputs,
                    std::span<MotionOutput> outputs) const = 0;
};

/// The largest state a motion model may keep for an object, bytes.
inline constexpr std::size_t max_motion_state = 256;

}  // namespace ringfence
