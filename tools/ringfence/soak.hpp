#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "job.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// A long run in which everything happens that may happen: objects and user nodes come and go, objects are placed and
/// taken out, CD nodes join, leave and fail, and calls are made that have to be refused. What has to hold is checked in
/// every frame (each candidate accepted once, each refusal counted by its reason) and, with --check, a share of the
/// frames against brute force.
class Soak {
 public:
  /// `world` is loaded with `scene`, and had a frame. Both outlive it.
  Soak(World& world, const worlds::Scene& scene, std::uint64_t seed);

  /// What is asked before the next frame.
  void make_requests();
  /// Looks at a frame's report. Whether all held.
  bool check_report(const FrameReport& report);

  struct Counts {
    std::uint64_t spawned = 0, destroyed = 0, placed = 0, removed = 0;
    std::uint64_t connected = 0, disconnected = 0;
    std::uint64_t resizes = 0, faults = 0, lost = 0, refused = 0;
    std::uint64_t failures = 0;  ///< frames in which something did not hold
  };
  const Counts& counts() const noexcept { return counts_; }

 private:
  struct Live {
    ObjectId id;
    Category category;
    UserNumber user;
  };

  bool one_in(std::uint32_t n) { return random_() % n == 0; }
  Pose random_pose();
  void spawn(UserNumber user);
  void destroy();
  void change_users();
  void change_nodes();
  void make_invalid_calls();
  void expect(Status got, Status reason);

  World& world_;
  const worlds::Scene& scene_;
  std::mt19937_64 random_;
  std::vector<Live> live_;
  std::vector<UserNumber> users_;
  std::vector<ShapeNumber> shapes_;  ///< of the scene's objects that may move
  ObjectId destroyed_id_;            ///< destroyed long ago, perhaps
  std::array<std::uint64_t, status_count> expected_{};
  Counts counts_;
};

/// Runs the job's world so for `minutes` and prints a summary. Answers the exit code: check_failed where something did
/// not hold, or memory has grown by more than a quarter since a tenth of the time had passed.
int run_soak(const Job& job, double minutes, std::uint64_t seed);

}  // namespace ringfence::tools
