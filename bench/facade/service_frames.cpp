#include "facade/service_frames.hpp"

#include <utility>

#include "base/prefetch.hpp"
#include "ringfence/world.hpp"
#include "worlds/load.hpp"

namespace ringfence::bench {
namespace {

/// Moves each object to a given pose, looked up by its number.
class RecordedMotion final : public MotionModel {
 public:
  /// Loads the poses into the cache, where an application that has just computed them would have them.
  void set_poses(std::span<const Pose> poses) noexcept {
    poses_ = poses.data();
    const auto* const first = reinterpret_cast<const std::byte*>(poses.data());
    for (std::size_t at = 0; at < poses.size_bytes(); at += 64) base::prefetch_for_read(first + at);
  }
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    // Inputs are in the order of the objects in memory, which is not that of their numbers.
    for (const MotionInput& input : inputs) base::prefetch_object(poses_[input.number - 1]);
    for (std::size_t i = 0; i < inputs.size(); ++i) outputs[i].pose = poses_[inputs[i].number - 1];
  }

 private:
  const Pose* poses_ = nullptr;
};

std::vector<std::uint64_t> keys_of(const World& world) {
  std::vector<std::uint64_t> keys;
  for (const Contact& contact : world.contacts()) keys.push_back(std::uint64_t{contact.a} << 32 | contact.b);
  return keys;
}

WorldConfig config_of(const RecordedWorld& recorded) {
  WorldConfig config;
  worlds::configure_for(config, recorded.scene, 0);
  return config;
}

class Service final : public FrameTester {
 public:
  Service(const RecordedWorld& recorded, std::uint32_t nodes, Placement placement)
      : motion_(std::make_shared<RecordedMotion>()), world_([&] {
          WorldConfig config = config_of(recorded);
          config.nodes = nodes;
          config.placement = placement;
          config.motion = motion_;
          return config;
        }()) {
    worlds::load_into(world_, recorded.scene, 0);
  }
  void run(const std::vector<Pose>& poses) override {
    motion_->set_poses(poses);
    require_ok(world_.advance());
  }
  std::size_t contacts() const override { return world_.contacts().size(); }
  std::vector<std::uint64_t> touching() const override { return keys_of(world_); }

 private:
  std::shared_ptr<RecordedMotion> motion_;
  World world_;
};

class Placed final : public FrameTester {
 public:
  explicit Placed(const RecordedWorld& recorded)
      : world_([&] {
          WorldConfig config = config_of(recorded);
          config.nodes = 0;
          config.deployment = Deployment::user_server;
          return config;
        }()) {
    worlds::load_into(world_, recorded.scene, 0);
    require_ok(world_.advance());
    for (const ObjectView& object : world_.objects()) ids_.push_back(object.id);
  }
  void run(const std::vector<Pose>& poses) override {
    for (std::size_t i = 0; i < ids_.size(); ++i) require_ok(world_.place(ids_[i], poses[i]));
    require_ok(world_.advance());
  }
  std::size_t contacts() const override { return world_.contacts().size(); }
  std::vector<std::uint64_t> touching() const override { return keys_of(world_); }

 private:
  World world_;
  std::vector<ObjectId> ids_;
};

}  // namespace

std::unique_ptr<FrameTester> make_service_frame(const RecordedWorld& world, std::uint32_t nodes, Placement placement) {
  return std::make_unique<Service>(world, nodes, placement);
}
std::unique_ptr<FrameTester> make_place_frame(const RecordedWorld& world) { return std::make_unique<Placed>(world); }

}  // namespace ringfence::bench
