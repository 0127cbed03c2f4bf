#pragma once

#include <cstdio>
#include <string>
#include <vector>

#include "cluster_model.hpp"
#include "options.hpp"
#include "output_file.hpp"
#include "scale_rows.hpp"

namespace ringfence::tools {

/// The resolved costs of a cluster and its predicted frames.
struct ClusterResult {
  ClusterCosts costs;
  std::vector<ClusterPrediction> predictions;
};

/// All results of `ringfence scale`. Rows are sorted by objects, deployment, placement and nodes.
struct ScaleResult {
  std::vector<ScaleRow> rows;
  double hops_ms = 0;  ///< message latency of a frame: wall time minus CPU time of a frame with one object
  std::vector<ClusterResult> clusters;  ///< empty if a signal ended the runs
  const char* ended_by = nullptr;       ///< the signal that ended the runs; `rows` has what was complete before
};

/// Prints the tables of the report.
void print_scale(std::FILE* out, const ScaleOptions& options, const ScaleResult& result);

void write_scale_json(OutputFile& out, const ScaleOptions& options, const ScaleResult& result);
void write_scale_csv(OutputFile& out, const ScaleResult& result);

}  // namespace ringfence::tools
