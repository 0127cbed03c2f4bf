#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <functional>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include "link/channel.hpp"
#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {

/// Runs the next frames of `harness` and returns all messages to CD node 0, in the order in which they were sent.
inline std::vector<LoggedMessage> script_of(TestHarness& harness, std::size_t frames) {
  std::vector<LoggedMessage> script;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    harness.frame();
    for (const LoggedMessage& seen : harness.log()) {
      if (seen.to == Endpoint::node(0)) {
        script.push_back(seen);
      }
    }
  }
  return script;
}

/// CD node 0 of a harness, alone, as in its own process: it receives all messages of the server through one ring and
/// those of the other nodes through another, and its messages are discarded.
class Replay {
 public:
  Replay(const HarnessConfig& config, const TestHarness& harness)
      : to_(std::size_t{1} << 20, nullptr, nullptr),
        from_peers_(std::size_t{1} << 20, nullptr, nullptr),
        from_(std::size_t{1} << 20, nullptr, nullptr) {
    CdNodeSetup setup;
    setup.shapes = &harness.shapes();
    setup.space = &harness.space();
    setup.model = config.model;
    setup.placement = config.placement;
    setup.layer_masks.fill(~0u);
    setup.max_slots = 1u << 12;
    setup.server = {&from_.sender(), &to_.receiver()};
    const regions::RegionMap map(config.grid, config.nodes);
    role_.emplace(setup, map);
    std::vector<Connection> peers(config.nodes, Connection{&from_.sender(), &from_peers_.receiver()});
    peers[0] = {};
    role_->assign(0, peers);
  }

  /// Sends it a message and steps it until it waits.
  void feed(std::span<const std::byte> message) {
    messages::Header header{};
    std::memcpy(&header, message.data(), std::min(message.size(), sizeof header));
    link::Sender& to = Endpoint{header.source}.is_node() ? from_peers_.sender() : to_.sender();
    const auto room = to.claim(message.size());
    REQUIRE(room.size() == message.size());
    std::copy(message.begin(), message.end(), room.begin());
    to.commit(message.size());
    to.publish();
    while (role_->step() == Step::progressed) {
      discard();
    }
    discard();
  }

  /// Sends it the messages of `script`; change(i, bytes) may change the i-th message.
  template <class Change>
  void run(std::span<const LoggedMessage> script, Change change) {
    for (std::size_t i = 0; i < script.size(); ++i) {
      std::vector<std::byte> bytes = script[i].bytes;
      change(i, bytes);
      feed(bytes);
    }
  }

  std::uint64_t invalid_messages() const { return role_->invalid_messages(); }

 private:
  void discard() {
    while (!from_.receiver().next().empty()) {
    }
    from_.receiver().release();
  }

  link::Channel to_, from_peers_, from_;
  std::optional<CdNodeRole> role_;
};

}  // namespace ringfence::nodes::test
