#pragma once

#include <memory>
#include <string>

#include "gateway/metrics_endpoint.hpp"

namespace ringfence::tools {

/// Listens at the address of --metrics, and prints the URL. Null if `address` is empty. Throws Error that names the
/// option if it is no address, or not one of this machine.
std::unique_ptr<gateway::MetricsEndpoint> open_metrics(const std::string& address);

}  // namespace ringfence::tools
