#include "node_metrics.hpp"

#include <chrono>

#include "metrics_option.hpp"

namespace ringfence::tools {

NodeMetrics::NodeMetrics(const std::string& address, const dds::NodeService& service)
    : service_(service), endpoint_(open_metrics(address)) {
  if (endpoint_ != nullptr) thread_ = std::jthread([this](const std::stop_token& stop) { renew(stop); });
}

void NodeMetrics::renew(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    endpoint_->set(service_.report());
    stopped_.wait_for(lock, stop, std::chrono::seconds(1), [] { return false; });
  }
}

}  // namespace ringfence::tools
