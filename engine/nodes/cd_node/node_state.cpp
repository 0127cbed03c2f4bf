#include "nodes/cd_node/node_state.hpp"

#include <utility>

namespace ringfence::nodes {

NodeState::NodeState(const CdNodeSetup& initial, const regions::RegionMap& map)
    : setup(initial),
      self(messages::Endpoint::node(initial.node)),
      region(map, *initial.space, initial.node, initial.slots()),
      fault(initial.faults),
      host(initial.model, initial.objects, &fault),
      objects(initial.objects, initial.placement == Placement::region),
      contacts(initial.exchange == ExchangeKind::shared ? *initial.server.node_contacts : own_contacts) {
  host.sense(initial.sense);
  host.list_host_owned(reports_rest());
  host.contacts().keep_one_frame();
  host.contacts().reserve(initial.objects);
  contacts.host = &host;
  contacts.objects = &objects;
}

void NodeState::assign(NodeNumber node, const std::vector<Connection>& peers) {
  setup.peers = peers;
  settle(node);
}

void NodeState::assign(NodeNumber node, std::shared_ptr<const SharedNodes> nodes) {
  setup.shared_nodes = std::move(nodes);
  settle(node);
}

void NodeState::settle(NodeNumber node) {
  setup.node = node;
  self = messages::Endpoint::node(node);
  region.assign(node, setup.slots());
}

void NodeState::begin(std::uint64_t new_frame) noexcept {
  objects.begin_frame(new_frame);
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
