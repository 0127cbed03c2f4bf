// The public class Cluster, and the report.
#include <memory>
#include <utility>

#include "dds/cluster_nodes.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::dds {

ClusterReport ClusterNodes::report() const {
  const std::lock_guard lock(mutex_);
  ClusterReport report = totals_;
  report.stale_parcels = stale_parcels_.load(std::memory_order_relaxed);
  for (const auto& node : assigned_by_slot_) {
    if (node == nullptr) {
      continue;
    }
    const ParcelChannel::Counters counters = node->parcel_channel->counters();
    MemberReport& member = report.members.emplace_back();
    member.name = node->name;
    member.node = NodeId(node->id);
    member.sent_parcels = counters.sent_parcels;
    member.sent_bytes = counters.sent_bytes;
    member.received_parcels = counters.received_parcels;
    member.received_bytes = counters.received_bytes;
    member.shared_bytes = counters.shared_bytes;
    member.refused_writes = counters.refused_writes;
    member.answers = counters.answers;
    member.answer_ms_mean =
        counters.answers == 0 ? 0 : telemetry::to_ms(counters.answer_ns) / static_cast<double>(counters.answers);
    member.answer_ms_max = telemetry::to_ms(counters.answer_ns_max);
    member.retransmitted_bytes = counters.retransmitted_bytes;
  }
  return report;
}

Cluster::Cluster(ClusterConfig config) : nodes_(std::make_shared<ClusterNodes>(std::move(config))) {}
Cluster::~Cluster() = default;

std::shared_ptr<RemoteNodes> Cluster::remote_nodes() const { return nodes_; }
std::uint32_t Cluster::domain() const noexcept { return nodes_->domain(); }
ClusterReport Cluster::report() const { return nodes_->report(); }

}  // namespace ringfence::dds
