#include "nodes/cd_node/migration.hpp"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <utility>

namespace ringfence::nodes {

using messages::Endpoint;

Migration::Migration(NodeState& state) : state_(state), peers_(state.setup.peers.size()) {
  leaving_.reserve(state.setup.objects);
}

void Migration::assign() {
  peers_.resize(state_.setup.peers.size());
  for (Peer& peer : peers_) {
    peer.lost = false;
    peer.leaving.reserve(state_.setup.objects / peers_.size() + 16);
  }
}

void Migration::begin() noexcept {
  leaving_.clear();
  received_ = 0;
  for (Peer& peer : peers_) {
    peer.lost = false;
    peer.received = 0;
  }
}

void Migration::list() {
  const Host& host = state_.host;
  for (Peer& peer : peers_) {
    peer.leaving.clear();
  }
  if (state_.region.take_change()) {
    for (std::size_t i = 0; i < host.size(); ++i) {
      const NodeNumber next = state_.region.owner_at(host[i].pose.position);
      if (next != state_.setup.node) {
        peers_[next].leaving.push_back(host[i].object.number);
      }
    }
  } else {
    for (const Leaving& leaving : leaving_) {
      host.prefetch_index(leaving.number);
    }
    for (const Leaving& leaving : leaving_) {
      host.prefetch_leaver(leaving.number);
    }
    for (const Leaving& leaving : leaving_) {
      assert(host.find(leaving.number) != base::NumberIndex::none);  // neither dropped nor handed over since it moved
      peers_[leaving.next].leaving.push_back(leaving.number);
    }
  }
  for (Peer& peer : peers_) {
    if (peer.lost) {
      drop(peer);
    } else if (!peer.leaving.empty()) {
      peer.run.start(peer.leaving.size());
    }
  }
}

bool Migration::send() {
  Host& host = state_.host;
  bool all = true;
  for (NodeNumber to = 0; to < peers_.size(); ++to) {
    Peer& peer = peers_[to];
    if (peer.run.done()) {
      continue;
    }
    state_.fault.pass(NodeStage::hand_over, state_.frame);
    all &= peer.run.pump(*state_.setup.peers[to].out, state_.head(messages::MessageType::hand_over, Endpoint::node(to)),
                         sizeof(messages::HandOverRecord) + host.state_bytes(), state_.traffic,
                         [&](std::size_t i, std::byte* where) {
                           const std::uint32_t hosted = host.find(peer.leaving[i]);
                           const messages::HandOverRecord record = host.hand_over(hosted);
                           std::memcpy(where, &record, sizeof record);
                           std::copy_n(host.state(hosted), host.state_bytes(), where + sizeof record);
                           host.drop(peer.leaving[i]);
                           ++state_.stats.handed_over;
                         });
  }
  return all;
}

void Migration::receive(const messages::MessageView& message) {
  Peer& peer = peers_[Endpoint{message.header().source}.number()];
  if (peer.lost) {
    return;  // the server has reclaimed its objects
  }
  peer.received += message.count();
  received_ += message.count();
  state_.host.adopt(message);
}

void Migration::lose(const messages::LostRecord& record) {
  Peer& peer = peers_[record.node];
  peer.lost = true;
  if (record.detect_again != 0) {
    return;
  }
  expected_ -= record.hand_overs;
  received_ -= std::exchange(peer.received, 0);
  if (state_.stage == CdNodeStage::handing_over) {
    drop(peer);
  }
}

void Migration::drop(Peer& peer) {
  for (const ObjectNumber number : peer.leaving) {
    state_.host.drop(number);
  }
  peer.leaving.clear();
  peer.run.stop();
}

}  // namespace ringfence::nodes
