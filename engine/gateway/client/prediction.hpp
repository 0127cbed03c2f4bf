#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "gateway/client/obstacles.hpp"
#include "gateway/client/replica.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::gateway {

/// The own avatar ahead of the server. Each tick of the client is a frame that the server will compute with the input
/// of that tick. An update says which input has taken effect and for how many frames; the ticks after it are computed
/// again from the state of the update, with the model of the server.
///
/// Where the avatar touches nothing, and each input takes effect for as many frames as it had ticks, the prediction has
/// the same bits as the server. Contacts with objects that move by themselves are not predicted. prediction.js does the
/// same for browsers.
class Prediction {
 public:
  /// `model` and `obstacles` outlive the prediction.
  Prediction(const MotionModel& model, Obstacles& obstacles) : model_(model), obstacles_(obstacles) {}

  /// One tick. `sequence`: number of its input, 1 or more; the same as that of the tick before, or a larger one.
  /// `input`: at most max_input_bytes.
  void tick(std::uint64_t sequence, std::span<const std::byte> input);
  /// Starts again from an update that `replica` has applied. Returns the distance in metres between the position that
  /// had been predicted for the update's frame and the one that the update has; none if there was no prediction.
  std::optional<double> reconcile(const Update& update, const Replica& replica);

  /// After the last tick; null if the client has no avatar.
  const Pose* pose() const noexcept { return has_avatar_ ? &pose_ : nullptr; }
  std::size_t waiting_ticks() const noexcept { return ticks_.size(); }

 private:
  struct Tick {
    std::uint64_t sequence = 0;
    std::uint64_t age = 0;  ///< ticks with this input before it
    std::array<std::byte, max_input_bytes> input{};
    std::size_t input_size = 0;
    Vec3d position;  ///< predicted after it
  };
  /// Removes the ticks that the server has computed. Returns the position that was predicted for the update's frame.
  std::optional<Vec3d> remove_done(const Update& update);
  void step(Tick& tick);

  const MotionModel& model_;
  Obstacles& obstacles_;
  std::deque<Tick> ticks_;                          ///< that the server has not computed, as far as the client knows
  std::uint64_t done_sequence_ = 0, done_age_ = 0;  ///< of the last tick that was removed
  bool has_avatar_ = false;
  std::uint64_t frame_ = 0;  ///< of the state
  ObjectNumber number_ = 0;
  ShapeId shape_;
  Pose pose_;
  alignas(8) std::array<std::byte, max_motion_state> state_{};
  std::vector<Contact> contacts_;  ///< of that frame
  std::vector<std::uint32_t> indices_;
};

}  // namespace ringfence::gateway
