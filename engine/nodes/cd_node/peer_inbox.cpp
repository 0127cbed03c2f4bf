#include "nodes/cd_node/peer_inbox.hpp"

#include <algorithm>
#include <utility>

namespace ringfence::nodes {

void PeerInbox::assign(std::span<const Connection> peers) {
  const std::vector<Input> old = std::exchange(inputs_, {});
  const auto find = [](const std::vector<Input>& inputs, const link::Receiver* ring) {
    return std::find_if(inputs.begin(), inputs.end(), [&](const Input& input) { return input.ring == ring; });
  };
  for (const Connection& peer : peers) {
    if (peer.in == nullptr || find(inputs_, peer.in) != inputs_.end()) {
      continue;
    }
    const auto known = find(old, peer.in);
    inputs_.push_back(known != old.end() ? *known : Input{peer.in, {}});
  }
}

}  // namespace ringfence::nodes
