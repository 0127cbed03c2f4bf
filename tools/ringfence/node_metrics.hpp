#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "gateway/metrics_endpoint.hpp"
#include "ringfence/cluster.hpp"

namespace ringfence::tools {

/// Serves the metrics of a node process while it exists, renewed once a second by a thread of its own.
class NodeMetrics {
 public:
  /// Does nothing if `address` is empty. `service` outlives it. Throws as open_metrics().
  NodeMetrics(const std::string& address, const dds::NodeService& service);

 private:
  void renew(const std::stop_token& stop);

  const dds::NodeService& service_;
  std::unique_ptr<gateway::MetricsEndpoint> endpoint_;
  std::mutex mutex_;
  std::condition_variable_any stopped_;
  std::jthread thread_;  ///< the last member: it uses all others
};

}  // namespace ringfence::tools
