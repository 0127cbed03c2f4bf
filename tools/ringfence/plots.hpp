#pragma once

#include <string>

#include "scale_report.hpp"

namespace ringfence::tools {

/// Throws Error when PREFIX.gnuplot cannot be written.
void check_plots(const std::string& prefix);

/// Writes PREFIX.gnuplot, figures included, and has gnuplot draw from it, each as SVG and as PNG:
/// with several object counts the paper's graphs, PREFIX-graph1 to 3 (frame time against objects in each deployment, a
/// line a node count) and PREFIX-graph4 (contacts); PREFIX-path (what the modelled frame is made of) and PREFIX-speedup
/// at the most objects; PREFIX-cluster-NAME for each modelled cluster. What the paper states is marked. With a second
/// placement its graphs end in -region.
///
/// Throws IncompleteError when gnuplot is missing or fails; everything else of the run has been written then.
void draw_plots(const std::string& prefix, const ScaleResult& result);

/// The gnuplot script, for a test to look at.
std::string plot_script(const std::string& prefix, const ScaleResult& result);

}  // namespace ringfence::tools
