#pragma once

#include <cstdint>

#include "motion/schedule.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::motion {

/// Parameters of the paper's motion. Lengths in metres, times in frames.
struct SteeringConfig {
  Vec3d bounds_min{0, 0, 0};
  Vec3d bounds_max{100, 100, 100};
  std::uint64_t seed = 1;
  std::uint32_t targets = 80;           ///< number of targets, 1 to 10^7
  Interval target_interval{200, 800};   ///< time between two relocations of a target
  Interval retarget_interval{60, 400};  ///< time after which an object chooses another target
  float speed = 0.3f;                   ///< speed of steering objects, metres a frame; > 0
  float spread = 1.5f;  ///< radius of the ball around a target that contains the goals of its objects; > 0
  float slop = 0.2f;    ///< overlap that is not resolved (an eighth of it for non-active objects); >= 0
  float push = 0.25f;   ///< longest step by which contacts push an object in a frame; > 0
};

/// The paper's motion and collision response as a motion model.
///
/// Targets relocate at random times. Objects that steer (avatars and active objects) choose another target at random
/// times and move towards a goal of their own near it, so objects cluster and disperse. An object in contact is pushed
/// out along the contact's normal, loses the velocity towards the other object, and is turned by the lever of the
/// contact. This, and the spread of goals over a ball, limits crowding. Non-active objects move only when they are
/// pushed, slow down, and come to rest exactly: their pose then keeps its bits. Motion never takes the centre of an
/// object out of the bounds.
///
/// Each target and each object has a home cell in a lattice over the bounds. A target stays within one and a half cells
/// of the centre of its home. An object chooses among the targets of the 27 cells around its own home. So the density
/// around an object does not depend on the number of objects, from 1000 to 1,000,000, and its goal is a pure function
/// of seed, number and frame. An object placed far from its home travels there first.
///
/// The result is a pure function of (seed, frame, object number, S(k-1), C(k-1)), computed with + - * / and sqrt only:
/// the same bits on every machine. `move` writes no shared state and allocates nothing; any number of threads may call
/// it.
class Steering final : public MotionModel {
 public:
  /// Throws Error that names the field which is out of range.
  explicit Steering(const SteeringConfig& config);

  std::size_t state_bytes() const noexcept override;
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override;

  /// The position of target `target` (below `targets`) in `frame`, and the first frame in which it may be elsewhere.
  Vec3d target_position(std::uint32_t target, std::uint64_t frame) const noexcept;
  std::uint64_t target_end(std::uint32_t target, std::uint64_t frame) const noexcept;

  /// The goal of a steering object in `frame`; for worlds that start with objects near their goals.
  Vec3d goal_of(ObjectNumber object, std::uint64_t frame) const noexcept;

  const SteeringConfig& config() const noexcept { return config_; }

 private:
  struct State;

  struct Goal {
    Vec3d position;
    std::uint64_t end;  ///< first frame in which it may be elsewhere
  };
  Goal find_goal(ObjectNumber object, std::uint64_t frame) const noexcept;
  std::uint32_t pick_target(ObjectNumber object, std::uint32_t epoch) const noexcept;
  void steer(const MotionInput& input, State& state) const noexcept;

  SteeringConfig config_;
  Schedule relocations_;
  Schedule picks_;
  Vec3d centre_;
  Vec3d cell_size_;             ///< size of a lattice cell, metres
  std::uint32_t lattice_side_;  ///< cells on each axis
};

}  // namespace ringfence::motion
