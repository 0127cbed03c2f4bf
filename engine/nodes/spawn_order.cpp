#include "nodes/spawn_order.hpp"

#include <algorithm>
#include <bit>
#include <numeric>

namespace ringfence::nodes {

std::span<const std::uint32_t> order_by_place(std::span<const Request> spawns, const geometry::FixedSpace& space,
                                              std::vector<std::uint32_t>& order) {
  // Rows so thick that a cube of their thickness holds a few: 32 on an axis for 64,000.
  const auto bits = static_cast<unsigned>(std::bit_width(spawns.size())) / 3;
  std::vector<std::uint64_t> places;
  places.reserve(spawns.size());
  for (const Request& spawn : spawns) {
    std::uint32_t point[3];
    space.point(spawn.spec.pose.position, point);
    const auto row = [&](std::uint32_t coordinate) { return std::uint64_t{coordinate} >> (32 - bits); };
    places.push_back((row(point[2]) << bits | row(point[1])) << 32 | point[0]);
  }
  order.resize(spawns.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t p, std::uint32_t q) { return places[p] < places[q]; });
  return order;
}

}  // namespace ringfence::nodes
