#include "queries/played_world.hpp"

#include "worlds/load.hpp"

namespace ringfence::bench {

PlayedWorld::PlayedWorld(const RecordedWorld& recorded, std::uint32_t history)
    : motion_(std::make_shared<PlayedMotion>()), world_([&] {
        WorldConfig config;
        worlds::configure_for(config, recorded.scene, 0);
        config.nodes = 0;
        config.motion = motion_;
        config.history = history;
        return config;
      }()) {
  worlds::load_into(world_, recorded.scene, 0);
}

}  // namespace ringfence::bench
