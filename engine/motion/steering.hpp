#pragma once

#include <cstdint>

#include "motion/schedule.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::motion {

/// How the paper's objects move. Lengths in metres, times in frames.
struct SteeringConfig {
  Vec3d bounds_min{0, 0, 0};
  Vec3d bounds_max{100, 100, 100};
  std::uint64_t seed = 1;
  std::uint32_t targets = 80;           ///< 1 to 10^7
  Interval target_interval{200, 800};   ///< a target relocates after a random time within
  Interval retarget_interval{60, 400};  ///< an object picks another target after a random time within
  float speed = 0.3f;                   ///< of an object that steers, metres a frame; > 0
  float spread = 1.5f;                  ///< radius of the ball about a target in which an object's own goal lies; > 0
  float slop = 0.2f;                    ///< overlap that is let stand (by non-active objects an eighth of it); >= 0
  float push = 0.25f;                   ///< the longest step that contacts push an object in a frame; > 0
};

/// The paper's motion and response as a motion model.
///
/// Targets relocate at random times; an object that steers (avatars and active ones) picks another target at random
/// times and moves towards a place of its own around it, so that objects cluster and disperse. Whatever is in
/// contact is pushed out along the contact's normal, loses the velocity that brings it closer, and is turned by the
/// lever of the contact: that, and goals spread over a ball, bounds the crowding. Non-active objects move only when
/// pushed, lose speed, and come to rest exactly: at rest their pose keeps its bits. The centre of an object never
/// leaves the bounds by its own motion.
///
/// Targets and objects each have a home in a lattice over the bounds: a target stays within one and a half cells of its
/// home's centre, an object picks among the targets of the 27 cells about its own. So what an object meets does not
/// depend on how many there are, from 1000 to 1,000,000, and where an object wants to be in a frame is a pure function
/// of seed, number and frame. An object placed far from its home travels there first.
///
/// Everything is a pure function of (seed, frame, object number, its S(k-1), its C(k-1)) in + - * / and sqrt: the same
/// bits on every machine. No shared state is written; `move` may run on any number of threads. It allocates nothing.
class Steering final : public MotionModel {
 public:
  /// Throws Error naming the field that is out of range.
  explicit Steering(const SteeringConfig& config);

  std::size_t state_bytes() const noexcept override;
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override;

  /// Where target `target` (below `targets`) is in `frame`, and until which frame it stays.
  Vec3d target_position(std::uint32_t target, std::uint64_t frame) const noexcept;
  std::uint64_t target_end(std::uint32_t target, std::uint64_t frame) const noexcept;

  /// Where an object that steers wants to be in `frame`; for worlds that start mid-way.
  Vec3d goal_of(ObjectNumber object, std::uint64_t frame) const noexcept;

  const SteeringConfig& config() const noexcept { return config_; }

 private:
  struct State;

  struct Goal {
    Vec3d position;
    std::uint64_t end;  ///< the first frame in which it may be elsewhere
  };
  Goal find_goal(ObjectNumber object, std::uint64_t frame) const noexcept;
  std::uint32_t pick_target(ObjectNumber object, std::uint32_t epoch) const noexcept;
  void steer(const MotionInput& input, State& state) const noexcept;

  SteeringConfig config_;
  Schedule relocations_;
  Schedule picks_;
  Vec3d centre_;
  Vec3d cell_;             ///< size of a lattice cell
  std::uint32_t lattice_;  ///< cells on each axis
};

}  // namespace ringfence::motion
