#include "link/frame_traffic.hpp"

#include <algorithm>
#include <memory>

#include "ringfence/world.hpp"
#include "worlds/load.hpp"
#include "worlds/paper_world.hpp"

namespace ringfence::bench {

FrameTraffic count_frame(std::uint32_t objects, std::uint32_t nodes) {
  constexpr int settling_frames = 20;
  worlds::PaperWorldOptions options;
  options.objects = objects;
  options.users = 0;
  const worlds::PaperWorld paper = worlds::make_paper_world(options);
  const auto model = std::make_shared<motion::Steering>(paper.steering);
  WorldConfig config;
  config.nodes = nodes;
  config.placement = Placement::server;
  config.balance = false;
  config.motion = model;
  worlds::configure_for(config, paper.scene, 0);
  World world(config);
  worlds::load_into(world, paper.scene, 0);
  for (int frame = 0; frame < settling_frames; ++frame) {
    if (const Status status = world.advance(); status != Status::ok) throw Error(name_of(status));
  }

  const FrameReport& report = world.report();
  FrameTraffic traffic;
  traffic.state_bytes = (model->state_bytes() + 7) / 8 * 8;
  // M2 has one record for each pair that a node tests; its other records are positions.
  std::uint64_t positions = report.traffic[static_cast<std::size_t>(Traffic::m2)].records;
  for (const NodeReport& node : report.nodes) positions -= std::min<std::uint64_t>(positions, node.candidates);
  for (const NodeReport& node : report.nodes) {
    NodeTraffic& node_traffic = traffic.nodes.emplace_back();
    node_traffic.states = node.hosted;
    node_traffic.positions = positions / report.nodes.size();
    node_traffic.pairs = node.candidates;
    node_traffic.collisions = node.contacts;
    node_traffic.changes = (report.began + report.ended) / report.nodes.size();
  }
  return traffic;
}

}  // namespace ringfence::bench
