#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// Collects what spectators receive about the server and its nodes; docs/client-protocol.md, "status".
class StatusText {
 public:
  /// `contact_label`: GatewayConfig::contact_label; outlives this object.
  StatusText(const World& world, const std::string& contact_label) : world_(world), contact_label_(contact_label) {}

  /// Adds the last frame.
  void add_frame();
  /// Writes the status since the last call of restart(). `has_map`: whether the receiver has the present region map.
  std::string text(std::size_t clients, std::optional<std::uint64_t> digest, bool has_map) const;
  /// Begins a new status.
  void restart();

 private:
  struct NodeLoad {
    NodeId id;
    std::uint64_t frames = 0;
    double busy_ms = 0;
    std::uint64_t pairs = 0, contacts = 0, hosted = 0;
  };
  NodeLoad& load_of(NodeId id);

  const World& world_;
  const std::string& contact_label_;
  std::vector<NodeLoad> loads_;
  std::vector<NodeId> lost_;
};

/// JSON about one object; docs/client-protocol.md, "described".
std::string described_text(const World& world, ObjectNumber number);

}  // namespace ringfence::gateway
