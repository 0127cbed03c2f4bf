#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "base/numbers.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::nodes {

/// Which objects the models of a CD node may sense: those within a distance of the box around what it hosts. Some of
/// them are too far away from every hosted object; they do not change any answer.
///
/// Threads: belongs to the server role. Memory: grows to the number of nodes.
class SensedRegions {
 public:
  /// Forgets all objects. `nodes`: number of node slots.
  void start(std::size_t nodes);
  /// A node hosts an object at that position.
  void add(NodeNumber node, const Vec3d& position) noexcept;
  /// Whether a node hosts an object.
  bool any(NodeNumber node) const noexcept { return boxes_[node].lower.x <= boxes_[node].upper.x; }
  /// Whether a ball comes within `distance` of the box of a node; true in case of doubt. Metres.
  bool reaches(NodeNumber node, const Vec3d& position, double radius, double distance) const noexcept;

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  struct Box {
    Vec3d lower{infinity, infinity, infinity};
    Vec3d upper{-infinity, -infinity, -infinity};
  };
  std::vector<Box> boxes_;  ///< by node slot
};

}  // namespace ringfence::nodes
