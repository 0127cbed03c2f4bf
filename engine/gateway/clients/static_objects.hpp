#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "ringfence/object.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// The static objects of the world by place: user nodes do not receive their states, but clients must see them.
///
/// Threads: one. Memory: about 100 bytes for each static object, and 4 for each cell that it touches.
class StaticObjects {
 public:
  struct Entry {
    ObjectNumber number = 0;
    double radius = 0;  ///< metres: of a ball around the position that contains the shape
    Pose pose;
  };

  /// Takes the enabled static objects of the world. `interest`: the usual radius of near(), metres.
  void rebuild(std::span<const ObjectView> objects, const World& world, double interest);
  /// Calls `visit(entry)` for each static object whose ball comes within `distance` of `position`; each once.
  template <class Visit>
  void near(const Vec3d& position, double distance, Visit&& visit) const {
    for (const std::uint32_t index : large_) visit_if_near(index, position, distance, visit);
    // An object is in the cell of its position. Its ball is not larger than a cell, so the cells around are enough.
    const double reach = distance + cell_;
    const auto [low_x, low_y] = cell_of(position.x - reach, position.y - reach);
    const auto [high_x, high_y] = cell_of(position.x + reach, position.y + reach);
    for (std::int64_t y = low_y; y <= high_y; ++y) {
      for (std::int64_t x = low_x; x <= high_x; ++x) {
        const auto found = cells_.find({x, y});
        if (found == cells_.end()) continue;
        for (const std::uint32_t index : found->second) visit_if_near(index, position, distance, visit);
      }
    }
  }
  std::size_t size() const noexcept { return entries_.size(); }

 private:
  struct Cell {
    std::int64_t x = 0, y = 0;
    bool operator==(const Cell&) const noexcept = default;
  };
  struct CellHash {
    std::size_t operator()(const Cell& cell) const noexcept;
  };
  Cell cell_of(double x, double y) const noexcept;
  template <class Visit>
  void visit_if_near(std::uint32_t index, const Vec3d& position, double distance, Visit&& visit) const {
    const Entry& entry = entries_[index];
    const double x = entry.pose.position.x - position.x, y = entry.pose.position.y - position.y,
                 z = entry.pose.position.z - position.z, reach = distance + entry.radius;
    if (x * x + y * y + z * z <= reach * reach) visit(entry);
  }

  double cell_ = 1;  ///< metres
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> large_;  ///< objects whose radius exceeds a cell
  std::unordered_map<Cell, std::vector<std::uint32_t>, CellHash> cells_;
};

}  // namespace ringfence::gateway
