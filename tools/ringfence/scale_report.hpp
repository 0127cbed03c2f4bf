#pragma once

#include <cstdio>
#include <string>
#include <vector>

#include "cluster_model.hpp"
#include "options.hpp"
#include "output_file.hpp"
#include "scale_rows.hpp"

namespace ringfence::tools {

/// A cluster as it holds for the runs, and what it would do.
struct ClusterResult {
  ClusterCosts costs;
  std::vector<ClusterPrediction> predictions;
};

/// Everything that `ringfence scale` found. Rows are in order of objects, deployment, placement, nodes.
struct ScaleResult {
  std::vector<ScaleRow> rows;
  double hops_ms = 0;  ///< wall time less CPU time of an empty frame
  std::vector<ClusterResult> clusters;
};

/// The tables that a person reads.
void print_scale(std::FILE* out, const ScaleOptions& options, const ScaleResult& result);

void write_scale_json(OutputFile& out, const ScaleOptions& options, const ScaleResult& result);
void write_scale_csv(OutputFile& out, const ScaleResult& result);

}  // namespace ringfence::tools
