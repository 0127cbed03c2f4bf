#pragma once

#include <array>
#include <unordered_map>
#include <vector>

#include "ringfence/frame_report.hpp"

namespace ringfence::tools {

/// The steps of the critical path of several frames, from which it computes a path without disturbances.
///
/// In each frame the slowest node of a step counts (see PathReport). With many nodes on few cores, that is often a node
/// that was held up in this frame only: by other load on the machine, by a page fault, or because its data left the
/// cache when another thread took the core. Such delays do not add up to much CPU time, but with hundreds of nodes
/// one of them has one in every frame.
///
/// Memory: PathReport::steps numbers for each frame, and 3 for each node and frame.
class PathSamples {
 public:
  void add(const FrameReport& report);

  /// The path with the median of each step over the frames, where the sums over the steps of a node are those of the
  /// node with the largest median. So it has the load of the busiest node, but not what a single node needed in single
  /// frames, be it a disturbance or work that is not done in every frame. All 0 without frames.
  PathReport undisturbed() const;

 private:
  /// The sums over the steps of one node, in each frame.
  struct Node {
    std::vector<double> moved, tested, ended;
  };

  std::array<std::vector<double>, PathReport::steps> steps_;
  std::unordered_map<NodeId, Node> nodes_;
};

}  // namespace ringfence::tools
