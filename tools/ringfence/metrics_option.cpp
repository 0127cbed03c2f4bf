#include "metrics_option.hpp"

#include <fmt/format.h>

#include "listen_address.hpp"

namespace ringfence::tools {

std::unique_ptr<gateway::MetricsEndpoint> open_metrics(const std::string& address) {
  if (address.empty()) return nullptr;
  const ListenAddress read = read_listen_address(address, "--metrics");
  auto endpoint = std::make_unique<gateway::MetricsEndpoint>(read.host, read.port);
  fmt::print(stderr, "ringfence: metrics at {}/metrics\n", endpoint->url());
  return endpoint;
}

}  // namespace ringfence::tools
