#include "ringfence/gateway.hpp"

#include <algorithm>
#include <utility>

#include "gateway/clients/clients.hpp"
#include "gateway/edge/edge.hpp"
#include "gateway/gateway_metrics.hpp"
#include "ringfence/error.hpp"
#include "telemetry/clock.hpp"

namespace ringfence {
namespace {

using gateway::EdgeConfig;

constexpr double close_limit_s = 2;
constexpr double max_rate = 1000;
constexpr double messages_per_frame = 2;
constexpr double metrics_period_s = 1;

// A client may send an input in each frame, also where frames are short.
gateway::EdgeLimits edge_limits(const GatewayConfig& config) {
  gateway::EdgeLimits limits;
  limits.messages_per_s = std::max(limits.messages_per_s, messages_per_frame * config.rate);
  limits.message_burst = std::max(limits.message_burst, 2 * limits.messages_per_s);
  return limits;
}

EdgeConfig edge_config(const GatewayConfig& config) {
  EdgeConfig edge;
  edge.limits = edge_limits(config);
  edge.host = config.host;
  edge.port = config.port;
  edge.certificate_file = config.certificate_file;
  edge.key_file = config.key_file;
  edge.token_key = config.token_key;
  edge.world = config.world;
  edge.max_clients = config.max_clients;
  edge.origins = config.origins;
  edge.page_directory = config.page_directory;
  edge.network = gateway::NetworkModel::parse(config.network);
  return edge;
}

GatewayConfig checked(GatewayConfig config) {
  if (!(config.rate > 0 && config.rate <= max_rate)) throw Error("GatewayConfig::rate: expected above 0, at most 1000");
  if (!(config.grace_s >= 0 && config.grace_s <= 1e6)) throw Error("GatewayConfig::grace_s: expected 0 to 10^6");
  if (config.max_clients == 0) throw Error("GatewayConfig::max_clients: expected at least 1");
  return config;
}

}  // namespace

struct Gateway::Implementation {
  Implementation(World& served, GatewayConfig given)
      : world(served),
        config(checked(std::move(given))),
        edge(edge_config(config)),
        clients(world, config, edge, [this](UserId user) { return edge.guest_token(user); }) {}

  World& world;
  GatewayConfig config;
  gateway::Edge edge;
  gateway::Clients clients;
  std::uint64_t frame_cpu_ns = 0;
  std::uint64_t metrics_at_ns = 0;
  bool is_closed = false;
};

Gateway::Gateway(World& world, GatewayConfig config)
    : implementation_(std::make_unique<Implementation>(world, std::move(config))) {}

Gateway::~Gateway() { close(); }

const std::string& Gateway::url() const noexcept { return implementation_->edge.url(); }

void Gateway::before_frame() {
  const std::uint64_t begin = telemetry::thread_cpu_ns();
  implementation_->clients.before_frame();
  implementation_->frame_cpu_ns += telemetry::thread_cpu_ns() - begin;
}

void Gateway::after_frame() {
  Implementation& self = *implementation_;
  const std::uint64_t begin = telemetry::thread_cpu_ns();
  self.clients.after_frame();
  if (const std::uint64_t now = telemetry::now_ns(); now >= self.metrics_at_ns) {
    self.metrics_at_ns = now + static_cast<std::uint64_t>(metrics_period_s * 1e9);
    self.edge.set_metrics(gateway::metrics_text(self.world, report()));
  }
  self.frame_cpu_ns += telemetry::thread_cpu_ns() - begin;
}

bool Gateway::send(UserId user, std::span<const std::byte> bytes) { return implementation_->clients.send(user, bytes); }

void Gateway::close() {
  Implementation& self = *implementation_;
  if (std::exchange(self.is_closed, true)) return;
  self.edge.stop_accepting();
  self.clients.close_all(gateway::CloseCode::going_away, "the world stops");
  self.edge.wait_until_empty(close_limit_s);
}

GatewayReport Gateway::report() const {
  const Implementation& self = *implementation_;
  const gateway::EdgeStatistics edge = self.edge.statistics();
  const gateway::Clients::Counts counts = self.clients.counts();
  GatewayReport report;
  report.players = counts.players;
  report.spectators = counts.spectators;
  report.away = counts.away;
  report.updates = self.clients.updates();
  report.replaced_updates = edge.replaced;
  report.received_messages = edge.received_messages;
  report.received_bytes = edge.received_bytes;
  report.sent_bytes = edge.sent_bytes;
  for (const std::uint64_t closed : edge.closed) report.refused += closed;
  report.frame_cpu_s = static_cast<double>(self.frame_cpu_ns) * 1e-9;
  report.network_cpu_s = edge.cpu_s;
  return report;
}

}  // namespace ringfence
