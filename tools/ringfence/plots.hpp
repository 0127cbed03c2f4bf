#pragma once

#include <string>

#include "scale_report.hpp"

namespace ringfence::tools {

/// Throws Error if PREFIX.gnuplot cannot be written.
void check_plots(const std::string& prefix);

/// Writes the script PREFIX.gnuplot, which contains the measured values, and runs gnuplot on it. Each plot is an SVG
/// and a PNG file:
/// - PREFIX-graph1 to -graph3, the paper's graphs: frame time by number of objects. There is one plot per deployment
///   and one line per node count. PREFIX-graph4: contacts. Only if there are several object counts.
/// - PREFIX-path: parts of the modelled frame, and PREFIX-speedup, both at the largest object count.
/// - PREFIX-cluster-NAME for each modelled cluster.
/// Values that the paper states are marked. Names of plots for a second placement end in -region.
///
/// Throws IncompleteError if gnuplot is missing or fails. Call it last, after all other outputs are written.
void draw_plots(const std::string& prefix, const ScaleResult& result);

/// The text of the gnuplot script.
std::string plot_script(const std::string& prefix, const ScaleResult& result);

}  // namespace ringfence::tools
