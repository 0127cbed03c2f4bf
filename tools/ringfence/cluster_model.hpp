#pragma once

#include <string>
#include <vector>

#include "cluster_costs.hpp"
#include "paper_figures.hpp"
#include "scale_rows.hpp"

namespace ringfence::tools {

/// Predicted parts of a frame on a cluster, in milliseconds and in the order of the frame. Their sum is the frame time.
struct ClusterFrame {
  double move = 0;    ///< motion on the busiest host
  double states = 0;  ///< M1 and node states to the server; states between user nodes
  double sweep = 0;   ///< broad phase on the server; 0 if the nodes do it
  double m2 = 0;
  double narrow = 0;  ///< reading M2 and testing pairs on the busiest node
  double m3 = 0;      ///< M3 and the state relay; with overlap only the part that exceeds the narrow phase
  double m4 = 0;      ///< M4, or M5 if that takes longer
  double hops = 0;    ///< latencies, and the messages that begin and end the frame
  double wait = 0;    ///< for a server that still has work of the frame, such as replicas, when the next could begin
  double total() const { return move + states + sweep + m2 + narrow + m3 + m4 + hops + wait; }
};

/// Time in milliseconds for which a frame occupies each resource.
struct ClusterLoad {
  double server_cpu = 0, server_link = 0, node = 0, user_lan = 0, latency = 0;
  /// Name of the most occupied resource, the one that saturates first.
  const char* limit() const;
};

struct ClusterPrediction {
  const ScaleRow* row = nullptr;  ///< the runs that the counts come from
  std::uint32_t nodes = 1;
  bool extrapolated = false;  ///< the counts at this node count are extrapolated, not measured
  ClusterFrame frame;
  double even_ms = 0;  ///< frame time if every node tested the same number of pairs
  ClusterLoad load;
  Scaling scaling;
  const PaperFigure* paper = nullptr;  ///< the paper's value; null if it states none or for another cluster
};

ClusterFrame compute_cluster_frame(const FrameCounts& counts, const ClusterCosts& costs);
ClusterLoad compute_cluster_load(const FrameCounts& counts, const ClusterCosts& costs);

/// Estimates the counts of a frame at `nodes` nodes from runs at one node and at `most.nodes` > 1 nodes.
///
/// Method: with n = nodes^(1/3) slices on each axis, an object of extent d in a world of side L overlaps
/// (1 + (n - 1) d / L)^3 regions, and hand-overs grow with the n - 1 region borders on each axis. Messages grow
/// linearly with the nodes. The excess of the busiest node over the mean grows with the square root of the number of
/// nodes, as the relative deviation of counts does.
FrameCounts extrapolated(const FrameCounts& one, const FrameCounts& most, std::uint32_t nodes);

/// Replaces the `measured` costs by values from the rows with one node, and fits the `fitted` cost.
ClusterCosts resolve_costs(ClusterCosts costs, const std::vector<ScaleRow>& rows);

/// One prediction for each row with nodes > 0. Where a world was run with 1 node and with more, also one for each
/// element of `extrapolated_nodes` above the highest node count. The result points into `rows`.
std::vector<ClusterPrediction> predict(const std::vector<ScaleRow>& rows, const ClusterCosts& costs,
                                       const std::vector<std::uint32_t>& extrapolated_nodes);

}  // namespace ringfence::tools
