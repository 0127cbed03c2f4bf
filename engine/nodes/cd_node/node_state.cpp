#include "nodes/cd_node/node_state.hpp"

namespace ringfence::nodes {

NodeState::NodeState(const CdNodeSetup& initial, const regions::RegionMap& map)
    : setup(initial),
      self(messages::Endpoint::node(initial.node)),
      region(map, *initial.space, initial.node, static_cast<std::uint32_t>(initial.peers.size())),
      fault(initial.faults),
      host(initial.model, initial.objects, &fault),
      objects(initial.objects, initial.placement == Placement::region),
      contacts(initial.exchange == ExchangeKind::shared ? *initial.server.node_contacts : own_contacts) {
  host.sense(initial.sense);
  host.contacts().keep_one_frame();
  host.contacts().reserve(initial.objects);
  contacts.host = &host;
}

void NodeState::assign(NodeNumber node, const std::vector<Connection>& peers) {
  setup.node = node;
  setup.peers = peers;
  self = messages::Endpoint::node(node);
  region.assign(node, static_cast<std::uint32_t>(peers.size()));
}

void NodeState::begin(std::uint64_t new_frame) noexcept {
  frame = new_frame;
  received = {};
  await_positions();
  region.discard_entries();
  host.contacts().begin(frame);
  stats = {};
}

void NodeState::await_positions() noexcept {
  received.positions = false;
  received.pairs = setup.placement == Placement::region;
}

}  // namespace ringfence::nodes
