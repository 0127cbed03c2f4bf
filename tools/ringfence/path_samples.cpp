#include "path_samples.hpp"

#include <algorithm>
#include <cstddef>

#include "medians.hpp"

namespace ringfence::tools {

void PathSamples::add(const FrameReport& report) {
  const auto steps = PathReport::all();
  for (std::size_t i = 0; i < steps.size(); ++i) steps_[i].push_back(report.path.*steps[i].second);
  for (const NodeReport& each : report.nodes) {
    Node& node = nodes_[each.id];
    node.moved.push_back(each.moved_ms);
    node.tested.push_back(each.tested_ms);
    node.ended.push_back(each.ended_ms);
  }
}

PathReport PathSamples::undisturbed() const {
  PathReport path;
  const auto steps = PathReport::all();
  for (std::size_t i = 0; i < steps.size(); ++i) path.*steps[i].second = median(steps_[i]);
  path.nodes_moved_ms = path.nodes_tested_ms = path.nodes_ended_ms = 0;
  for (const auto& [id, node] : nodes_) {
    path.nodes_moved_ms = std::max(path.nodes_moved_ms, median(node.moved));
    path.nodes_tested_ms = std::max(path.nodes_tested_ms, median(node.tested));
    path.nodes_ended_ms = std::max(path.nodes_ended_ms, median(node.ended));
  }
  return path;
}

}  // namespace ringfence::tools
