#include "nodes/server/objects/spawn_order.hpp"

#include <algorithm>
#include <bit>
#include <tuple>

namespace ringfence::nodes {

namespace {

/// `Spawn` has a member `spec`.
template <class Spawn>
std::span<const PositionedSpawn> order(std::span<const Spawn> spawns, const geometry::FixedSpace& space,
                                       base::SystemVector<PositionedSpawn>& scratch) {
  // log2 of the number of rows on an axis: 32 rows for 64,000 objects. A cube as thick as a row then contains a few
  // objects.
  const auto bits = static_cast<unsigned>(std::bit_width(spawns.size())) / 3;
  const auto row = [&](std::uint32_t coordinate) { return std::uint64_t{coordinate} >> (32 - bits); };
  scratch.clear();
  for (std::uint32_t i = 0; i < spawns.size(); ++i) {
    std::uint32_t point[3];
    space.point(spawns[i].spec.pose.position, point);
    scratch.push_back({(row(point[2]) << bits | row(point[1])) << 32 | point[0], i});
  }
  std::sort(scratch.begin(), scratch.end(), [](const PositionedSpawn& p, const PositionedSpawn& q) {
    return std::tie(p.place, p.position) < std::tie(q.place, q.position);
  });
  return scratch;
}

}  // namespace

std::span<const PositionedSpawn> order_by_position(std::span<const Request> spawns, const geometry::FixedSpace& space,
                                                   base::SystemVector<PositionedSpawn>& scratch) {
  return order(spawns, space, scratch);
}
std::span<const PositionedSpawn> order_by_position(std::span<const RestoredObject> objects,
                                                   const geometry::FixedSpace& space,
                                                   base::SystemVector<PositionedSpawn>& scratch) {
  return order(objects, space, scratch);
}

}  // namespace ringfence::nodes
