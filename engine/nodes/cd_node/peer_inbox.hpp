#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "link/channel.hpp"
#include "messages/header.hpp"
#include "nodes/role.hpp"

namespace ringfence::nodes {

/// The messages that other CD nodes send directly to this one, from one ring for each node, or from one for all. A node
/// may be ahead of this one: then its message stays in the ring, with all behind it, until this node can use it.
///
/// Threads: belongs to the CD node.
class PeerInbox {
 public:
  enum class Verdict : std::uint8_t { take, drop, wait };

  /// Sets the connections to the other nodes, by slot. Between frames. What waits in a ring that remains is kept.
  void assign(std::span<const Connection> peers);

  /// Reads all messages up to the first of each ring that has to wait. Calls judge(message) for each, again for those
  /// that have waited, then take(message) for those to take, and refuse() for those that cannot be decoded. Returns
  /// whether any message was taken or dropped.
  template <class Judge, class Take, class Refuse>
  bool read(std::size_t state_bytes, Judge judge, Take take, Refuse refuse);

 private:
  struct Input {
    link::Receiver* ring;
    std::span<const std::byte> waiting;  ///< read from the ring, not taken yet
  };
  std::vector<Input> inputs_;
};

inline void PeerInbox::assign(std::span<const Connection> peers) {
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

template <class Judge, class Take, class Refuse>
bool PeerInbox::read(std::size_t state_bytes, Judge judge, Take take, Refuse refuse) {
  bool any = false;
  for (Input& input : inputs_) {
    bool passed = false;
    for (;;) {
      const std::span<const std::byte> bytes = input.waiting.empty() ? input.ring->next() : input.waiting;
      if (bytes.empty()) {
        break;
      }
      input.waiting = {};
      messages::MessageView message;
      if (messages::decode(bytes, state_bytes, message) != Status::ok) {
        refuse();
      } else if (const Verdict verdict = judge(message); verdict == Verdict::wait) {
        input.waiting = bytes;
        break;
      } else if (verdict == Verdict::take) {
        take(message);
      }
      passed = true;
    }
    any |= passed;
    if (passed && input.waiting.empty()) {
      input.ring->release();
    }
  }
  return any;
}

}  // namespace ringfence::nodes
