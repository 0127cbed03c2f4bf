#include "nodes/exchange/node/shared_exchange.hpp"

#include "base/prefetch.hpp"

namespace ringfence::nodes {

SharedExchange::SharedExchange(NodeState& state)
    : NodeExchange(state), keeps_states_(state.keeps_host_owned() && state.setup.may_be_lost) {
  scratch_.reserve(state.setup.objects);
  if (keeps_states_) {
    state.contacts.host_states.reserve(state.setup.objects, state.host.state_bytes());
  }
}

void SharedExchange::begin() {
  NodeExchange::begin();
  state_.contacts.host_states.begin(state_.frame);
}

bool SharedExchange::report_batch() {
  state_.stats.host_owned_changes += owned_.size();
  for (std::size_t i = 0; keeps_states_ && i < owned_.size(); ++i) {
    const Hosted& object = state_.host[owned_[i]];
    state_.contacts.host_states.add(state_.frame, object.object, object.pose, state_.host.state(owned_[i]));
  }
  owned_.clear();
  return send_changes();
}

bool SharedExchange::finish_report() {
  state_.contacts.host_states.finish();
  state_.contacts.ghost_updates.finish(static_cast<NodeNumber>(state_.setup.peers.size()));
  return finish_changes();
}

bool SharedExchange::receive_ghosts(HaloExchange& halo) {
  ReadGate& gate = state_.contacts.ghost_updates.gate;
  if (!gate.enter()) {
    return true;
  }
  state_.fault.pass(NodeStage::gate, state_.frame);
  ghosts_.clear();
  for (const Connection& peer : state_.setup.peers) {
    const bool used = peer.node_contacts != nullptr;  // not an empty slot, nor this node
    if (used && peer.node_contacts->ghost_updates.frame() == state_.frame) {
      peer.node_contacts->ghost_updates.list(state_.setup.node, ghosts_);
    }
  }
  halo.apply(ghosts_.span());
  gate.leave();
  return true;
}

void SharedExchange::share_contacts() {
  NodeContacts& contacts = state_.contacts;
  if (!contacts.gate.enter()) {
    return;  // this node is lost, and the shared memory may already belong to the next frame
  }
  state_.fault.pass(NodeStage::gate, state_.frame);
  contacts.duplicates = write_slice(*contacts.output_merge, contacts.share, scratch_);
  if (state_.setup.hosts) {
    read_peer_contacts();
  }
  contacts.gate.leave();
}

void SharedExchange::read_peer_contacts() {
  const auto all = state_.contacts.output_merge->node_contacts;
  NodeContactOrder& order = scratch_.order;
  order.start(all);
  // Other cores wrote the keys, and each peer has only a few for this node: prefetch all of them before the first read.
  for (const NodeContacts* node_contacts : all) {
    for (const std::uint32_t position : node_contacts->for_peers.of(state_.setup.node)) {
      base::prefetch_for_read(&node_contacts->keys[position]);
    }
  }
  for (NodeNumber peer = 0; peer < all.size(); ++peer) {
    for (const std::uint32_t position : all[peer]->for_peers.of(state_.setup.node)) {
      order.add(peer, position);
    }
  }
  order.sort();
  order.visit([&](std::uint64_t, NodeNumber peer, std::uint32_t position, Phase phase) {
    Contact contact;
    all[peer]->write(all[peer]->found[position], phase, contact);
    state_.host.contacts().add(state_.frame, contact);
  });
  state_.contacts.taken = order.size();
}

}  // namespace ringfence::nodes
