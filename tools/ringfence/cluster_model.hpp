#pragma once

#include <string>
#include <vector>

#include "cluster_costs.hpp"
#include "paper_figures.hpp"
#include "scale_rows.hpp"

namespace ringfence::tools {

/// A frame on a cluster, computed from counts and costs: milliseconds, in the order of the frame. They add up to it.
struct ClusterFrame {
  double move = 0;    ///< the busiest host
  double states = 0;  ///< M1 and node states to the server, and what user nodes tell each other
  double sweep = 0;   ///< broad phase, where the server does it
  double m2 = 0;
  double narrow = 0;  ///< the busiest node, reading M2 included
  double m3 = 0;      ///< and the relay; with overlap only what lasts longer than the narrow phase
  double m4 = 0;      ///< or M5 where that takes longer
  double hops = 0;    ///< latencies, and the messages that begin and end a frame
  double total() const { return move + states + sweep + m2 + narrow + m3 + m4 + hops; }
};

/// How long each resource works in the frame, milliseconds.
struct ClusterLoad {
  double server_cpu = 0, server_link = 0, node = 0, user_lan = 0, latency = 0;
  /// The one that works longest: what saturates.
  const char* limit() const;
};

struct ClusterPrediction {
  const ScaleRow* row = nullptr;  ///< whose counts
  std::uint32_t nodes = 1;
  bool extrapolated = false;  ///< counts are not measured at this node count
  ClusterFrame frame;
  double even_ms = 0;  ///< the frame if every node tested the same number of pairs
  ClusterLoad load;
  Scaling scaling;
  const PaperFigure* paper = nullptr;  ///< what the paper states for it; only for the paper's cluster
};

ClusterFrame compute_cluster_frame(const FrameCounts& counts, const ClusterCosts& costs);
ClusterLoad compute_cluster_load(const FrameCounts& counts, const ClusterCosts& costs);

/// Counts at more nodes than were run, from those at one node and at the most that were run. `most.nodes` > 1.
///
/// Geometry: an object of extent d in a world of side L cut into n = nodes^(1/3) slices an axis is in
/// (1 + (n - 1) d / L)^3 regions, and crosses n - 1 borders' worth of faces; messages grow by a constant a node; the
/// busiest node's lead over the mean grows as the square root of the nodes, as that of counts does.
FrameCounts extrapolated(const FrameCounts& one, const FrameCounts& most, std::uint32_t nodes);

/// A cluster's costs as they hold for these runs: measured ones taken from the rows at one node, fitted ones fitted.
ClusterCosts resolve_costs(ClusterCosts costs, const std::vector<ScaleRow>& rows);

/// A prediction for every row with nodes, and where rows at 1 node and at more are there, for `beyond` too.
std::vector<ClusterPrediction> predict(const std::vector<ScaleRow>& rows, const ClusterCosts& costs,
                                       const std::vector<std::uint32_t>& extrapolated_nodes);

}  // namespace ringfence::tools
