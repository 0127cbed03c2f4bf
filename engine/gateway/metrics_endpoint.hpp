#pragma once

#include <cstdint>
#include <string>

#include "gateway/edge/edge.hpp"
#include "ringfence/cluster.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// Serves the metrics of a World that has no clients, or of a node process, at /metrics of a loopback address, by a
/// thread of its own.
class MetricsEndpoint {
 public:
  /// Port 0: any free one. Throws Error if the address is not of this machine, or cannot be listened at.
  MetricsEndpoint(const std::string& host, std::uint16_t port);

  const std::string& url() const noexcept { return edge_.url(); }
  /// Replaces what /metrics has.
  void set(const World& world);
  void set(const dds::NodeServiceReport& report);

 private:
  Edge edge_;
};

}  // namespace ringfence::gateway
