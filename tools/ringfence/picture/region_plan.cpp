#include "picture/region_plan.hpp"

#include <algorithm>
#include <cstdint>
#include <map>

namespace ringfence::tools {
namespace {

constexpr std::size_t levels = 64;  // of a column

/// The middle of part `at` of `parts` equal parts.
double middle(double min, double max, std::size_t at, std::size_t parts) {
  return min + (max - min) * (static_cast<double>(at) + 0.5) / static_cast<double>(parts);
}

}  // namespace

RegionPlan::RegionPlan(const World& world) : columns_(side * side) {
  const Vec3d min = world.config().bounds_min, max = world.config().bounds_max;
  std::map<std::vector<std::uint32_t>, std::size_t> known;  // by the numbers of the nodes
  std::vector<std::uint32_t> column;
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) {
      column.clear();
      for (std::size_t z = 0; z < levels; ++z) {
        const auto node = world.node_at(
            {middle(min.x, max.x, x, side), middle(min.y, max.y, y, side), middle(min.z, max.z, z, levels)});
        if (node && std::find(column.begin(), column.end(), node->number()) == column.end())
          column.push_back(node->number());
      }
      const auto [found, added] = known.try_emplace(column, owners_.size());
      if (added) {
        std::vector<NodeId>& nodes = owners_.emplace_back();
        for (const std::uint32_t number : column) nodes.emplace_back(number);
      }
      columns_[y * side + x] = found->second;
    }
  }
}

// Greedy: the longest row of equal columns, then as many rows as are equal.
std::vector<RegionPlan::Area> RegionPlan::areas() const {
  std::vector<Area> areas;
  std::vector<bool> covered(columns_.size());
  const auto is_free = [&](std::size_t x, std::size_t y, std::size_t owners) {
    return !covered[y * side + x] && at(x, y) == owners;
  };
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) {
      if (covered[y * side + x]) continue;
      Area area{x, y, x + 1, y + 1, at(x, y)};
      while (area.end_x < side && is_free(area.end_x, y, area.owners)) ++area.end_x;
      const auto row_is_free = [&](std::size_t row) {
        for (std::size_t i = area.x; i < area.end_x; ++i) {
          if (!is_free(i, row, area.owners)) return false;
        }
        return true;
      };
      while (area.end_y < side && row_is_free(area.end_y)) ++area.end_y;
      for (std::size_t row = area.y; row < area.end_y; ++row) {
        const auto begin = covered.begin() + static_cast<std::ptrdiff_t>(row * side);
        std::fill(begin + static_cast<std::ptrdiff_t>(area.x), begin + static_cast<std::ptrdiff_t>(area.end_x), true);
      }
      areas.push_back(area);
    }
  }
  return areas;
}

std::vector<RegionPlan::Boundary> RegionPlan::boundaries() const {
  std::vector<Boundary> found;
  // Adds the runs of `differs(i)`; `piece(begin, end)` makes the boundary of a run.
  const auto add_runs = [&found](auto differs, auto piece) {
    for (std::size_t i = 0; i < side; ++i) {
      const std::size_t begin = i;
      while (i < side && differs(i)) ++i;
      if (i != begin) found.push_back(piece(begin, i));
    }
  };
  for (std::size_t line = 1; line < side; ++line) {
    add_runs([&](std::size_t y) { return at(line - 1, y) != at(line, y); },
             [&](std::size_t begin, std::size_t end) {
               return Boundary{line, begin, line, end};
             });
    add_runs([&](std::size_t x) { return at(x, line - 1) != at(x, line); },
             [&](std::size_t begin, std::size_t end) {
               return Boundary{begin, line, end, line};
             });
  }
  return found;
}

std::optional<RegionPlan::Area> RegionPlan::first_area(std::size_t owners, std::size_t width,
                                                       std::size_t height) const {
  std::vector<std::size_t> run(side);  // of equal columns upwards from the current row, by x
  std::optional<Area> found;
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) run[x] = at(x, y) == owners ? run[x] + 1 : 0;
    std::size_t across = 0;
    for (std::size_t x = 0; x < side; ++x) {
      across = run[x] >= height ? across + 1 : 0;
      if (across == width) {
        found = Area{x + 1 - width, y + 1 - height, x + 1, y + 1, owners};
        break;
      }
    }
  }
  return found;
}

}  // namespace ringfence::tools
