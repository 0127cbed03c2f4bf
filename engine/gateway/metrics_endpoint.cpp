#include "gateway/metrics_endpoint.hpp"

#include "gateway/gateway_metrics.hpp"

namespace ringfence::gateway {
namespace {

EdgeConfig config_of(const std::string& host, std::uint16_t port) {
  EdgeConfig config;
  config.host = host;
  config.port = port;
  config.serves_clients = false;
  return config;
}

}  // namespace

MetricsEndpoint::MetricsEndpoint(const std::string& host, std::uint16_t port) : edge_(config_of(host, port)) {}

void MetricsEndpoint::set(const World& world) { edge_.set_metrics(metrics_text(world)); }
void MetricsEndpoint::set(const dds::NodeServiceReport& report) { edge_.set_metrics(metrics_text(report)); }

}  // namespace ringfence::gateway
