#include "figures.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace ringfence::tools {
namespace {

void add_to(std::vector<KindReport>& totals, const KindReport& kind) {
  const auto order = [](const KindReport& report) { return std::pair(report.first, report.second); };
  auto at = std::lower_bound(totals.begin(), totals.end(), kind,
                             [&](const KindReport& p, const KindReport& q) { return order(p) < order(q); });
  if (at == totals.end() || order(*at) != order(kind)) {
    totals.insert(at, kind);
    return;
  }
  at->candidates += kind.candidates;
  at->hits += kind.hits;
  at->lanes += kind.lanes;
  at->lanes_filled += kind.lanes_filled;
  at->iterations += kind.iterations;
  at->ended_early += kind.ended_early;
  at->timed += kind.timed;
  at->nanoseconds += kind.nanoseconds;
  at->gather_nanoseconds += kind.gather_nanoseconds;
  for (std::size_t i = 0; i < cost_buckets; ++i) at->cost[i] += kind.cost[i];
}

NodeFigures& totals_of(std::vector<NodeFigures>& totals, std::uint32_t id) {
  auto at = std::lower_bound(totals.begin(), totals.end(), id,
                             [](const NodeFigures& node, std::uint32_t wanted) { return node.id < wanted; });
  if (at == totals.end() || at->id != id) {
    at = totals.emplace(at);
    at->id = id;
  }
  return *at;
}

}  // namespace

void Figures::add(const FrameReport& report, std::span<const Contact> frame_contacts) {
  digest_.add_frame(frame_contacts);
  frame_ms_.push_back(report.frame_ms);
  for (std::size_t i = 0; i < stage_count; ++i) stage_ms_[i] += report.stage_ms[i];
  for (std::size_t i = 0; i < status_count; ++i) refused_[i] += report.refused[i];
  for (std::size_t i = 0; i < traffic_count; ++i) {
    traffic_[i].messages += report.traffic[i].messages;
    traffic_[i].records += report.traffic[i].records;
    traffic_[i].bytes += report.traffic[i].bytes;
  }
  candidates += report.candidates;
  tested += report.tested;
  carried += report.carried;
  accepted += report.accepted;
  contacts += report.contacts;
  began += report.began;
  ended += report.ended;
  for (const auto& [name, counter] : FrameReport::counters()) totals.*counter += report.*counter;
  objects = report.objects;
  server_cpu_ms += report.server_cpu_ms;
  users_cpu_ms += report.users_cpu_ms;
  for (const auto& [name, step] : PathReport::all()) path.*step += report.path.*step;
  critical_ms += report.path.critical_ms();
  for (const NodeId node : report.lost) losses.push_back({frames() - 1, false, node.number(), report.frame_ms});
  for (const UserId user : report.late) losses.push_back({frames() - 1, true, user.number(), report.frame_ms});
  map_changes += map_epoch_ == 0 ? 0 : report.map_epoch - map_epoch_;
  map_epoch_ = report.map_epoch;
  const auto add_values = [&](Imbalance& imbalance, auto value) {
    values_.clear();
    for (const NodeReport& node : report.nodes) values_.push_back(value(node));
    imbalance.add(values_);
  };
  add_values(cpu_imbalance, [](const NodeReport& node) { return node.cpu_ms; });
  add_values(tested_imbalance, [](const NodeReport& node) { return static_cast<double>(node.tested); });
  for (const KindReport& kind : report.kinds) add_to(kinds_, kind);
  for (const NodeReport& node : report.nodes) {
    NodeFigures& total = totals_of(node_totals_, node.id.number());
    total.busy_ms += node.busy_ms;
    total.cpu_ms += node.cpu_ms;
    total.wait_ms += node.wait_ms;
    total.move_ms += node.move_ms;
    total.broad_phase_ms += node.broad_phase_ms;
    total.narrow_phase_ms += node.narrow_phase_ms;
    total.candidates += static_cast<double>(node.candidates);
    total.tested += static_cast<double>(node.tested);
    total.carried += static_cast<double>(node.carried);
    total.contacts += static_cast<double>(node.contacts);
    total.hosted += static_cast<double>(node.hosted);
    total.handed_over += static_cast<double>(node.handed_over);
  }
}

Spread Figures::frame_ms() const {
  if (frame_ms_.empty()) return {};
  std::vector<double> sorted = frame_ms_;
  std::sort(sorted.begin(), sorted.end());
  const auto rank = [&](double share) {  // nearest-rank percentile: a measured time, not an interpolated one
    const auto at = static_cast<std::size_t>(std::ceil(share * static_cast<double>(sorted.size())));
    return sorted[std::max<std::size_t>(at, 1) - 1];
  };
  return {mean(std::accumulate(sorted.begin(), sorted.end(), 0.0)), rank(0.5), rank(0.99), sorted.back()};
}

std::vector<NodeFigures> Figures::nodes() const {
  std::vector<NodeFigures> means = node_totals_;
  for (NodeFigures& node : means) {
    for (double* const value :
         {&node.busy_ms, &node.cpu_ms, &node.wait_ms, &node.move_ms, &node.broad_phase_ms, &node.narrow_phase_ms,
          &node.candidates, &node.tested, &node.carried, &node.contacts, &node.hosted, &node.handed_over}) {
      *value = mean(*value);
    }
  }
  return means;
}

}  // namespace ringfence::tools
