#include "link/frame_traffic.hpp"

#include <memory>

#include "messages/header.hpp"
#include "messages/records.hpp"
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
  // The report counts M2 as a whole. The numbers of its two kinds of records follow from their sizes.
  const TrafficReport& m2 = report.traffic[static_cast<std::size_t>(Traffic::m2)];
  const std::uint64_t records_bytes = m2.bytes - m2.messages * sizeof(messages::Header);
  const std::uint64_t positions = (records_bytes - m2.records * sizeof(messages::PairRecord)) /
                                  (sizeof(messages::PositionRecord) - sizeof(messages::PairRecord));
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
