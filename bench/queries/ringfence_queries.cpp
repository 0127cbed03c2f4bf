#include <memory>

#include "facade/recorded_world.hpp"
#include "queries/played_world.hpp"
#include "queries/query_scene.hpp"
#include "ringfence/world.hpp"
#include "worlds/load.hpp"

namespace ringfence::bench {
namespace {

/// Snapshots of a World without threads. `update` records the frame and builds the index.
class Ringfence final : public QueryTester {
 public:
  explicit Ringfence(const QueryScene& scene)
      : scene_(scene), motion_(std::make_shared<PlayedMotion>()), world_([&] {
          WorldConfig config;
          worlds::configure_for(config, scene.scene, 0);
          config.nodes = 0;
          config.motion = motion_;
          return config;
        }()) {
    worlds::load_into(world_, scene.scene, 0);
    const ShapeId ball = world_.add_shape(Sphere{scene.ball_radius});
    sweeps_ = scene.sweeps;
    overlaps_ = scene.overlaps;
    for (SweepQuery& query : sweeps_) query.shape = ball;
    for (OverlapQuery& query : overlaps_) query.shape = ball;
  }

  void move(const std::vector<Pose>& poses) override {
    motion_->set_poses(poses.data());
    snapshot_ = {};
    require_ok(world_.advance());
  }
  void update(const std::vector<Pose>&) override {
    snapshot_ = world_.snapshot();
    (void)snapshot_.nearest(NearestQuery{{}, 0});  // the first query builds the index
  }
  void cast(std::span<FirstAnswer> out) override {
    hits_.resize(scene_.rays.size());
    snapshot_.cast(scene_.rays, hits_);
    take(out, &Hit::fraction);
  }
  void sweep(std::span<FirstAnswer> out) override {
    hits_.resize(sweeps_.size());
    snapshot_.sweep(sweeps_, hits_);
    take(out, &Hit::fraction);
  }
  void find_nearest(std::span<FirstAnswer> out) override {
    hits_.resize(scene_.nearest.size());
    snapshot_.nearest(scene_.nearest, hits_);
    take(out, &Hit::distance);
  }
  std::size_t overlap() override {
    snapshot_.overlap(overlaps_, lists_);
    return lists_.all().size();
  }

 private:
  void take(std::span<FirstAnswer> out, double Hit::*place) const {
    for (std::size_t i = 0; i < hits_.size(); ++i) out[i] = {hits_[i].object.number(), hits_[i].*place};
  }

  const QueryScene& scene_;
  std::shared_ptr<PlayedMotion> motion_;
  World world_;
  Snapshot snapshot_;
  std::vector<SweepQuery> sweeps_;
  std::vector<OverlapQuery> overlaps_;
  std::vector<Hit> hits_;
  HitLists lists_;
};

}  // namespace

std::unique_ptr<QueryTester> make_ringfence_queries(const QueryScene& scene) {
  return std::make_unique<Ringfence>(scene);
}

}  // namespace ringfence::bench
