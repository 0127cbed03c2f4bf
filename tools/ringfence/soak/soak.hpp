#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include "ringfence/world.hpp"
#include "worlds/scene.hpp"

namespace ringfence::tools {

/// Makes random requests to a world: objects are spawned, destroyed, placed, disabled, enabled and steered; shapes are
/// registered and removed; objects are changed; some are 10^15 m away; users connect, disconnect, stop and make more
/// avatars than they may; CD nodes join, leave and stop between and inside stages; threads cannot be created; and
/// invalid calls are made. Checks in every frame that each
/// candidate is accepted exactly once and that each refusal is counted under its reason. One thread.
class Soak {
 public:
  /// Precondition: `scene` is loaded into `world`, or `world` was restored; then one frame has run. Both must outlive
  /// the soak.
  Soak(World& world, const worlds::Scene& scene, std::uint64_t seed);

  /// To be called before each frame.
  void make_requests();
  /// To be called after each frame. False if a check failed.
  bool check_report(const FrameReport& report);
  /// To be called instead after a frame that is not checked.
  void note_late_users(const FrameReport& report);

  struct Counts {
    std::uint64_t spawned = 0, destroyed = 0, placed = 0, disabled = 0, enabled = 0, changed = 0;
    std::uint64_t connected = 0, disconnected = 0, late = 0, inputs = 0, shapes = 0, shapes_removed = 0;
    std::uint64_t resizes = 0, faults = 0, lost = 0, released = 0, without_thread = 0, refused = 0, floods = 0;
    std::uint64_t failures = 0;  ///< frames and calls in which a check failed
  };
  const Counts& counts() const noexcept { return counts_; }

 private:
  struct Live {
    ObjectId id;
    Category category;
    UserId user;
  };

  bool one_in(std::uint32_t n) { return random_() % n == 0; }
  Pose random_pose();
  void spawn(UserId user);
  void flood(UserId user);
  void give_input(const Live& avatar);
  void destroy();
  void change_users();
  void change_nodes();
  void resize();
  void stop_node();
  void stop_user();
  void change(const Live& object);
  void remove_shape();
  void add_shape();
  void remove_user(UserId user);
  void inject(const Fault& fault);
  void make_invalid_calls();
  void expect(Status got, Status reason);

  World& world_;
  const worlds::Scene& scene_;
  std::mt19937_64 random_;
  std::vector<Live> live_;
  std::vector<UserId> users_;
  std::vector<ShapeId> shapes_;           ///< of the scene's movable objects
  std::optional<ShapeId> retired_shape_;  ///< to be removed
  ObjectId destroyed_id_;                 ///< of a destroyed object; invalid if there is none yet
  std::array<std::uint64_t, status_count> expected_{};
  bool lost_last_ = false;               ///< a node was lost in the last frame
  bool thread_failure_pending_ = false;  ///< an injected failure to create a thread has not occurred yet
  Counts counts_;
};

}  // namespace ringfence::tools
