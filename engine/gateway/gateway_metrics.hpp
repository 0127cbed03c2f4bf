#pragma once

#include <string>

#include "ringfence/cluster.hpp"
#include "ringfence/gateway.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// What /metrics has of the world, in the Prometheus text format.
std::string metrics_text(const World& world);
/// What it has of the world and of its clients, in the Prometheus text format.
std::string metrics_text(const World& world, const GatewayReport& report);
/// What it has of a node process, in the Prometheus text format.
std::string metrics_text(const dds::NodeServiceReport& report);

}  // namespace ringfence::gateway
