#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "facade/recorded_world.hpp"
#include "ringfence/world.hpp"

namespace ringfence::bench {

/// Moves each object to a given pose, looked up by its number.
class PlayedMotion final : public MotionModel {
 public:
  void set_poses(const Pose* poses) noexcept { poses_ = poses; }
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) outputs[i].pose = poses_[inputs[i].number - 1];
  }

 private:
  const Pose* poses_ = nullptr;
};

/// A World without nodes that plays a recording back.
class PlayedWorld {
 public:
  explicit PlayedWorld(const RecordedWorld& recorded, std::uint32_t history = 0);
  /// Runs a frame with these poses, which the next frame replaces.
  void advance(const std::vector<Pose>& poses) {
    motion_->set_poses(poses.data());
    require_ok(world_.advance());
  }
  World& world() noexcept { return world_; }

 private:
  std::shared_ptr<PlayedMotion> motion_;
  World world_;
};

}  // namespace ringfence::bench
