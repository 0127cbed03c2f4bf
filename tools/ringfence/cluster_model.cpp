#include "cluster_model.hpp"

#include <algorithm>
#include <cmath>

#include "cluster_traffic.hpp"
#include "medians.hpp"
#include "messages/records.hpp"

namespace ringfence::tools {
namespace {

constexpr double hops_per_frame = 6;  // begin, states, M2, M3, M4, frame done

double ms(double us) { return us * 1e-3; }

/// Times in milliseconds of the parts of a frame, from which both the frame time and the load are composed.
struct Parts {
  double user_move, node_move, server_move;
  double states_cpu, states_link, user_lan;
  double replicas_cpu, replicas_link;
  double sweep_server, sweep_node;
  double m2_cpu, m2_link, m2_node;
  double test_node;
  double m3_cpu, m3_link, relay_cpu, relay_link;
  double m4_cpu, m4_link, end_node;
  double frame_cpu, frame_link;
  double latency;
};

Parts parts_of(const FrameCounts& counts, const ClusterCosts& costs) {
  const double message = ms(costs[CostName::message_us]), record = ms(costs[CostName::record_us]);
  const double byte = 8e-3 / costs[CostName::bandwidth_mbit];
  const double users = std::max(1.0, counts.users), nodes = std::max(1.0, counts.nodes);
  const double lead = counts.tested > 0 ? counts.busiest_tested * nodes / counts.tested : 1;
  const double copies = costs[CostName::user_copies] > 0 ? costs[CostName::user_copies] : users - 1;
  const ClusterTraffic traffic = traffic_of(counts, costs);
  const auto cpu = [&](const MeanTraffic& sent) { return sent.messages * message + sent.records * record; };
  const auto link = [&](const MeanTraffic& sent) { return sent.bytes * byte; };

  Parts parts{};
  parts.user_move = counts.user_hosted / users * (ms(costs[CostName::move_us]) + record);
  parts.node_move = counts.node_hosted / nodes * (ms(costs[CostName::move_us]) + record);
  parts.server_move = counts.server_hosted * ms(costs[CostName::move_us]);
  parts.states_cpu = cpu(traffic.states);
  parts.states_link = link(traffic.states);
  parts.replicas_cpu = cpu(traffic.replicas);
  parts.replicas_link = link(traffic.replicas);
  // A shared segment carries all copies. With links of their own, user nodes send their states and receive all others.
  const double m1_bytes = std::max(0.0, counts[Traffic::m1].bytes - traffic.user_bytes);
  parts.user_lan = costs[CostName::shared_user_lan] > 0
                       ? (m1_bytes + traffic.user_bytes * copies) * byte
                       : std::max((m1_bytes + traffic.user_bytes * copies) / users, traffic.user_bytes) * byte;
  const double sweep = counts.objects * ms(costs[CostName::object_us]);
  parts.sweep_server = counts.placement == Placement::server ? sweep : 0;
  parts.sweep_node = counts.placement == Placement::server ? 0 : sweep * regions_per_object(counts) * lead / nodes;
  parts.m2_cpu = cpu(traffic.m2);
  parts.m2_link = link(traffic.m2);
  parts.m2_node = cpu(traffic.node_m2) + link(traffic.node_m2);
  parts.test_node = counts.busiest_tested * ms(costs[CostName::pair_us]);
  parts.m3_cpu = cpu(traffic.m3);
  parts.m3_link = link(traffic.m3);
  parts.relay_cpu = cpu(traffic.relay);
  parts.relay_link = link(traffic.relay);
  parts.m4_cpu = cpu(traffic.m4);
  parts.m4_link = link(traffic.m4);
  parts.end_node = cpu(traffic.node_end) + link(traffic.node_end);
  parts.frame_cpu = cpu(traffic.frame);
  parts.frame_link = link(traffic.frame);
  parts.latency = hops_per_frame * ms(costs[CostName::latency_us]);
  return parts;
}

ClusterLoad load_of(const Parts& parts) {
  ClusterLoad load;
  load.server_cpu = parts.server_move + parts.states_cpu + parts.replicas_cpu + parts.sweep_server + parts.m2_cpu +
                    parts.m3_cpu + parts.relay_cpu + parts.m4_cpu + parts.frame_cpu;
  load.server_link = std::max(parts.states_link + parts.replicas_link + parts.m3_link,
                              parts.m2_link + parts.m4_link + parts.relay_link);
  load.node = parts.node_move + parts.m2_node + parts.sweep_node + parts.test_node + parts.end_node;
  load.user_lan = parts.user_lan;
  load.latency = parts.latency;
  return load;
}

}  // namespace

const char* ClusterLoad::limit() const {
  const std::pair<double, const char*> loads[] = {{server_cpu, "server's CPU"},
                                                  {server_link, "server's link"},
                                                  {node, "busiest node"},
                                                  {user_lan, "user LAN"},
                                                  {latency, "latency"}};
  return std::max_element(std::begin(loads), std::end(loads))->second;
}

ClusterFrame compute_cluster_frame(const FrameCounts& counts, const ClusterCosts& costs) {
  const Parts parts = parts_of(counts, costs);
  ClusterFrame frame;
  frame.move = std::max({parts.user_move, parts.node_move, parts.server_move});
  frame.states = parts.states_cpu + std::max(parts.states_link, parts.user_lan);
  frame.sweep = parts.sweep_server;
  frame.m2 = parts.m2_cpu + parts.m2_link;
  frame.narrow = parts.m2_node + parts.sweep_node + parts.test_node;
  const double m3 = parts.m3_cpu + parts.relay_cpu + std::max(parts.m3_link, parts.relay_link);
  frame.m3 = costs[CostName::overlap] > 0 ? std::max(0.0, m3 - frame.narrow) : m3;
  frame.m4 = std::max(parts.m4_cpu + parts.m4_link, parts.end_node);
  frame.hops = parts.latency + parts.frame_cpu + parts.frame_link;
  const ClusterLoad load = load_of(parts);
  frame.wait = std::max(0.0, std::max(load.server_cpu, load.server_link) - frame.total());
  return frame;
}

ClusterLoad compute_cluster_load(const FrameCounts& counts, const ClusterCosts& costs) {
  return load_of(parts_of(counts, costs));
}

FrameCounts extrapolated(const FrameCounts& one, const FrameCounts& most, std::uint32_t nodes) {
  const double n = std::cbrt(static_cast<double>(nodes)), n_most = std::cbrt(most.nodes);
  FrameCounts counts = most;
  counts.nodes = nodes;
  const double lead = most.tested > 0 ? most.busiest_tested * most.nodes / most.tested : 1;
  counts.busiest_tested = std::max(1.0, most.tested / nodes) * (1 + (lead - 1) * std::sqrt(nodes / most.nodes));
  counts.busiest_tested = std::min(counts.busiest_tested, most.tested);
  counts.handed_over = most.handed_over * (n - 1) / (n_most - 1);

  for (std::size_t i = 0; i < traffic_count; ++i) {
    const MeanTraffic &low = one.traffic[i], &high = most.traffic[i];
    const double steps = (nodes - 1) / (most.nodes - 1);
    counts.traffic[i].messages = low.messages + (high.messages - low.messages) * steps;
    if (static_cast<Traffic>(i) != Traffic::control) continue;
    counts.traffic[i].records = low.records + (high.records - low.records) * steps;
    counts.traffic[i].bytes = low.bytes + (high.bytes - low.bytes) * steps;
  }
  const double regions_most = regions_per_object(most);
  const double extent = (std::cbrt(regions_most) - 1) / (n_most - 1);
  const double more = (std::pow(1 + extent * (n - 1), 3) - regions_most) * most.moved;
  MeanTraffic& m2 = counts[Traffic::m2];
  m2.records += more;
  m2.bytes += more * sizeof(messages::PositionRecord);
  MeanTraffic& m5 = counts[Traffic::m5];
  const double crossings = most.handed_over > 0 ? counts.handed_over / most.handed_over : 1;
  m5.records *= crossings;
  m5.bytes *= crossings;
  if (regions_most > 1) counts.node_notices *= (regions_per_object(counts) - 1) / (regions_most - 1);
  return counts;
}

namespace {

/// Replaces the measured costs by medians over the runs with one node.
void measure_costs(ClusterCosts& costs, const std::vector<ScaleRow>& rows) {
  std::vector<double> pair, move, object;
  for (const ScaleRow& row : rows) {
    if (row.nodes != 1 || row.counts().tested <= 0) continue;
    for (const ScaleSample& sample : row.samples) {
      const FrameCounts& counts = sample.counts;
      const double sweep = row.counts().placement == Placement::server ? sample.broad_phase_ms : 0;
      if (row.counts().placement == Placement::server) pair.push_back(1e3 * sample.narrow_phase_ms / counts.tested);
      if (row.counts().placement == Placement::server) object.push_back(1e3 * sweep / counts.objects);
      if (counts.node_hosted > 0) move.push_back(1e3 * sample.move_ms / counts.node_hosted);
    }
  }
  const auto settle = [&](CostName name, const std::vector<double>& values, const char* how) {
    Cost& cost = costs.at(name);
    if (!cost.measured) return;
    if (values.empty()) {
      cost.source = "default: no run at 1 node measures it";
      return;
    }
    cost.value = median(values);
    cost.source = how;
  };
  settle(CostName::pair_us, pair, "measured here: a node's narrow-phase time divided by its pairs, 1 node");
  settle(CostName::move_us, move, "measured here: a node's move time divided by its hosted objects, 1 node");
  settle(CostName::object_us, object, "measured here: the server's broad-phase time divided by the objects");
}

/// Fits pair_us by bisection, so that the predicted frame of user-collision at 1 node and 4000 objects takes as long as
/// the paper states.
void fit_pair(ClusterCosts& costs, const std::vector<ScaleRow>& rows) {
  Cost& pair = costs.at(CostName::pair_us);
  const PaperFigure* anchor = paper_figure(Deployment::user_collision, 1, 4000);
  for (const ScaleRow& row : rows) {
    if (row.deployment != anchor->deployment || row.nodes != anchor->nodes || row.objects != anchor->objects) continue;
    double low = 0, high = 1e6;
    for (int step = 0; step < 60; ++step) {  // the frame time increases with pair_us
      pair.value = (low + high) / 2;
      (compute_cluster_frame(row.counts(), costs).total() < anchor->ms ? low : high) = pair.value;
    }
    return;
  }
  pair.source = "default, fitted earlier to the paper's 4100 ms: user-collision, 1 node, 4000 objects was not run";
}

}  // namespace

ClusterCosts resolve_costs(ClusterCosts costs, const std::vector<ScaleRow>& rows) {
  measure_costs(costs, rows);
  if (costs.at(CostName::pair_us).fitted) fit_pair(costs, rows);
  return costs;
}

std::vector<ClusterPrediction> predict(const std::vector<ScaleRow>& rows, const ClusterCosts& costs,
                                       const std::vector<std::uint32_t>& extrapolated_nodes) {
  std::vector<ClusterPrediction> predictions;
  const auto add = [&](const ScaleRow& row, const FrameCounts& counts, std::uint32_t nodes, bool is_extrapolated) {
    ClusterPrediction prediction;
    prediction.row = &row;
    prediction.nodes = nodes;
    prediction.extrapolated = is_extrapolated;
    prediction.frame = compute_cluster_frame(counts, costs);
    FrameCounts even = counts;
    even.busiest_tested = counts.tested / counts.nodes;
    prediction.even_ms = compute_cluster_frame(even, costs).total();
    prediction.load = compute_cluster_load(counts, costs);
    if (const ScaleRow* one = find_row(rows, row, 1)) {
      const double one_ms = compute_cluster_frame(one->counts(), costs).total();
      prediction.scaling = scaling_of(one_ms, prediction.frame.total(), nodes);
    }
    if (costs.name == "2004") prediction.paper = paper_figure(row.deployment, nodes, row.objects);
    predictions.push_back(prediction);
  };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const ScaleRow& row = rows[i];
    if (row.nodes == 0) continue;
    const ScaleRow* one = find_row(rows, row, 1);
    FrameCounts counts = row.counts();
    if (one != nullptr) {
      counts.node_notices = std::max(0.0, counts[Traffic::m4].records - one->counts()[Traffic::m4].records);
    }
    add(row, counts, row.nodes, false);
    const bool last_of_world = i + 1 == rows.size() || !rows[i + 1].same_world(row);
    if (!last_of_world || one == nullptr || row.nodes <= 1) continue;
    for (const std::uint32_t nodes : extrapolated_nodes) {
      if (nodes > row.nodes) add(row, extrapolated(one->counts(), counts, nodes), nodes, true);
    }
  }
  return predictions;
}

}  // namespace ringfence::tools
