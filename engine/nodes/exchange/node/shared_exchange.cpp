#include "nodes/exchange/node/shared_exchange.hpp"

#include "base/prefetch.hpp"
#include "messages/run.hpp"
#include "nodes/cd_node/migration.hpp"

namespace ringfence::nodes {

SharedExchange::SharedExchange(NodeState& state)
    : NodeExchange(state),
      frame_control_(*state.setup.frame_control),
      keeps_states_(state.keeps_host_owned() && state.setup.may_be_lost) {
  scratch_.reserve(state.setup.objects);
  if (state.setup.hosts) {
    state.contacts.hand_overs.reserve(state.setup.objects / 8 + 64, state.host.state_bytes());
  }
  if (keeps_states_) {
    state.contacts.host_states.reserve(state.setup.objects, state.host.state_bytes());
  }
}

void SharedExchange::assign() { state_.setup.server.out->set_quiet(true); }

void SharedExchange::finish_step() {
  if (note_messages()) {
    frame_control_.wake_server();
  }
}

// The server reads only the rings of nodes that have noted messages.
bool SharedExchange::note_messages() noexcept {
  const bool any = state_.setup.server.out->take_unrung();
  if (any) {
    frame_control_.note_messages(state_.setup.node);
  }
  return any;
}

FrameControl::Announced SharedExchange::announced() const noexcept {
  const FrameControl::Announced announced = frame_control_.announced();
  // After the load: what was announced before the node was lost concerns it, and what was announced after does not.
  return state_.contacts.report.dismissed.load(std::memory_order_relaxed) ? FrameControl::Announced() : announced;
}

void SharedExchange::reach(ReportedStep step) noexcept {
  note_messages();
  // Pairs with the load in ReportReader: what the node has written for this step is visible.
  state_.contacts.report.reached.store({state_.frame, state_.region.map().epoch(), step}, std::memory_order_release);
  frame_control_.arrive(state_.setup.node, step);
}

void SharedExchange::begin() {
  NodeExchange::begin();
  StepReport& report = state_.contacts.report;
  report.ghosts = report.taken = report.duplicates = 0;
  state_.contacts.host_states.begin(state_.frame);
}

bool SharedExchange::report_batch() {
  state_.stats.host_owned_changes += owned_.size();
  for (std::size_t i = 0; keeps_states_ && i < owned_.size(); ++i) {
    const Hosted& object = state_.host[owned_[i]];
    state_.contacts.host_states.add(state_.frame, object.object, object.pose, state_.host.state(owned_[i]));
  }
  owned_.clear();
  const bool sent = send_changes();
  note_messages();
  if (!sent) {
    frame_control_.wake_server();  // it has to make room
  }
  return sent;
}

bool SharedExchange::finish_report() {
  state_.contacts.host_states.finish();
  GhostUpdates& updates = state_.contacts.ghost_updates;
  updates.finish(state_.setup.slots());
  state_.contacts.report.ghosts = updates.size();
  state_.contacts.report.next_hosts = next_hosts_.span();
  updates.each_receiver([this](NodeNumber to) { add_to_senders(&NodeContacts::ghost_senders, to); });
  flush();
  reach(ReportedStep::moved);
  return true;
}

// A slot without a node owns nothing, so nothing is listed for it, unless a map still names it.
void SharedExchange::add_to_senders(SenderSet NodeContacts::*senders, NodeNumber receiver) const noexcept {
  if (NodeContacts* const to = (*state_.setup.shared_nodes)[receiver]) {
    (to->*senders).add(state_.setup.node);
  }
}

bool SharedExchange::receive_ghosts(HaloExchange& halo) {
  ReadGate& gate = state_.contacts.ghost_updates.gate;
  if (!gate.enter()) {
    return true;
  }
  state_.fault.pass(NodeStage::gate, state_.frame);
  ghosts_.clear();
  const SharedNodes& nodes = *state_.setup.shared_nodes;
  state_.contacts.ghost_senders.take([&](NodeNumber sender) {
    const bool used = sender < nodes.size() && nodes[sender] != nullptr;
    if (used && nodes[sender]->ghost_updates.frame() == state_.frame) {
      nodes[sender]->ghost_updates.list(state_.setup.node, ghosts_);
    }
  });
  halo.apply(ghosts_.span());
  gate.leave();
  return true;
}

void SharedExchange::begin_contacts() {
  state_.contacts.for_peers.each_peer([this](NodeNumber to) { add_to_senders(&NodeContacts::contact_senders, to); });
}

bool SharedExchange::send_contacts(const messages::NarrowDoneRecord& totals) {
  state_.contacts.report.totals = totals;
  reach(ReportedStep::tested);
  return true;
}

void SharedExchange::share_contacts() {
  NodeContacts& contacts = state_.contacts;
  if (!contacts.gate.enter()) {
    return;  // this node is lost, and the shared memory may already belong to the next frame
  }
  state_.fault.pass(NodeStage::gate, state_.frame);
  if (!contacts.output_merge->server_writes) {
    contacts.report.duplicates = write_slice(*contacts.output_merge, contacts.share, scratch_);
  }
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
  senders_.clear();
  state_.contacts.contact_senders.take([&](NodeNumber peer) {
    if (peer >= all.size() || all[peer]->frame != state_.frame) {
      return;
    }
    senders_.push_back(peer);
    for (const std::uint32_t position : all[peer]->for_peers.of(state_.setup.node)) {
      base::prefetch_for_read(&all[peer]->keys[position]);
    }
  });
  for (const NodeNumber peer : senders_) {
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
  state_.contacts.report.taken = order.size();
}

void SharedExchange::list_hand_overs(const PeerLists& leaving) {
  const Host& host = state_.host;
  HandOverList& list = state_.contacts.hand_overs;
  list.start(host.state_bytes());
  leaving.each_peer([&](NodeNumber to) {
    state_.fault.pass(NodeStage::hand_over, state_.frame);
    for (const ObjectNumber number : leaving.of(to)) {
      const std::uint32_t hosted = host.find(number);
      list.add(to, host.hand_over(hosted), host.state(hosted));
    }
  });
  list.finish(state_.setup.slots(), state_.frame, state_.region.map().epoch());
  // After the list is finished: a receiver that takes the hint before that takes another one later.
  leaving.each_peer([this](NodeNumber to) { add_to_senders(&NodeContacts::hand_over_senders, to); });
  if (state_.received.frame_end) {  // before that no node waits
    leaving.each_peer([this](NodeNumber to) {
      const NodeContacts* const receiver = (*state_.setup.shared_nodes)[to];
      if (receiver != nullptr && receiver->bell != nullptr) {
        receiver->bell->ring();
      }
    });
  }
}

void SharedExchange::start_hand_overs(const PeerLists& leaving) {
  leaving.each_peer([&](NodeNumber to) {
    const auto objects = leaving.of(to);
    messages::count_message(state_.traffic, state_.head(messages::MessageType::hand_over, messages::Endpoint::node(to)),
                            sizeof(messages::HandOverRecord) + state_.host.state_bytes(), objects.size());
    state_.stats.handed_over += objects.size();
    for (const ObjectNumber number : objects) {
      state_.host.drop(number);
    }
  });
}

void SharedExchange::receive_hand_overs(Migration& migration) {
  ReadGate& gate = state_.contacts.hand_over_gate;
  if (migration.is_complete() || !gate.enter()) {
    return;
  }
  state_.fault.pass(NodeStage::gate, state_.frame);
  const SharedNodes& nodes = *state_.setup.shared_nodes;
  state_.contacts.hand_over_senders.take([&](NodeNumber sender) {
    const bool used = sender < nodes.size() && nodes[sender] != nullptr && !migration.is_lost(sender);
    if (used && nodes[sender]->hand_overs.is_for(state_.frame, state_.region.map().epoch())) {
      migration.receive(sender, nodes[sender]->hand_overs);
    }
  });
  migration.is_complete() ? gate.leave() : gate.pause();
}

bool SharedExchange::report_done(const messages::NodeFrameStats& stats) {
  state_.contacts.report.stats = stats;
  reach(ReportedStep::done);
  return true;
}

}  // namespace ringfence::nodes
