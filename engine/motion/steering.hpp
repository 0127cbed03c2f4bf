#pragma once

#include <cstdint>
#include <string_view>

#include "motion/schedule.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::motion {

/// Parameters of the motion in the paper (docs/paper-map.md). Lengths in metres, times in frames.
struct SteeringConfig {
  Vec3d bounds_min{0, 0, 0};        ///< lower corner of the box that the centres of objects do not leave; finite
  Vec3d bounds_max{100, 100, 100};  ///< upper corner; above bounds_min on each axis
  std::uint64_t seed = 1;
  std::uint32_t targets = 80;           ///< number of targets, 1 to 10^7
  Interval target_interval{200, 800};   ///< time between two relocations of a target
  Interval retarget_interval{60, 400};  ///< time after which an object chooses another target
  float speed = 0.3f;                   ///< speed of steering objects, metres a frame; > 0
  float spread = 1.5f;  ///< radius of the ball around a target that contains the goals of its objects; > 0
  float slop = 0.2f;    ///< overlap depth that is not resolved; for non-active objects an eighth of it; >= 0
  float push = 0.25f;   ///< longest step by which contacts push an object in a frame; > 0
};

/// The paper's motion and collision response as a motion model.
///
/// Targets relocate at random times. Objects that steer (avatars and active objects) choose another target at random
/// times. Each moves towards a goal of its own near its target, so objects cluster and disperse. A contact pushes an
/// object out along the normal, damps its velocity towards the other object, and turns it as a force at the contact
/// point would. The pushes, and the spread of goals over a ball, limit crowding. Non-active objects move only when they
/// are pushed, and slow down. When they come to rest their velocity becomes exactly 0, and their pose no longer
/// changes. Motion never takes the centre of an object out of the bounds.
///
/// Each target and each object has a home cell in a lattice over the bounds. A target stays within one and a half cells
/// of the centre of its home on each axis. An object chooses among the targets of its home cell and of the 26 cells
/// around it. So in worlds whose bounds and number of targets grow with the number of objects, the density around an
/// object stays the same, from 1000 to 1,000,000 objects. The goal of an object is a pure function of configuration,
/// number and frame. An object placed far from its home travels there first.
///
/// The result is a pure function of (configuration, frame, object number, S(k-1), C(k-1)), computed with + - * / and
/// sqrt only: the same bits on every machine. `move` writes no shared state and allocates nothing; any number of
/// threads may call it.
class Steering final : public MotionModel {
 public:
  /// Throws Error if a field is out of range. The message names the field; for an interval it quotes the two values.
  explicit Steering(const SteeringConfig& config);

  std::string_view name() const noexcept override { return "steering"; }
  /// A hash of the configuration.
  std::uint64_t version() const noexcept override;
  std::size_t state_bytes() const noexcept override;
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override;

  /// The position of target `target` (below `targets`) in `frame`.
  Vec3d target_position(std::uint32_t target, std::uint64_t frame) const noexcept;
  /// The first frame after `frame` in which that target may be elsewhere.
  std::uint64_t target_end(std::uint32_t target, std::uint64_t frame) const noexcept;

  /// The goal of a steering object in `frame`, within the bounds. Worlds place objects near their goals with it.
  Vec3d goal_of(ObjectNumber object, std::uint64_t frame) const noexcept;

  const SteeringConfig& config() const noexcept { return config_; }

 private:
  struct State;

  struct Goal {
    Vec3d position;
    std::uint64_t end;  ///< first frame in which the goal may be elsewhere
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
