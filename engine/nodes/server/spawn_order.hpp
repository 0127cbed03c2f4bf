#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/bounds.hpp"
#include "nodes/server/request.hpp"

namespace ringfence::nodes {

struct PositionedSpawn {
  std::uint64_t place;     ///< of the row in which it stands, then along the row
  std::uint32_t position;  ///< in the list of spawns
};

/// In which order objects that are spawned one after the other at one cut get their slots: by place, in rows along x,
/// as a sweep comes by them. So the rows, states, bodies and contacts of objects that meet are near each other in
/// memory, with the server and with every host. What moves away from its place loses that, nothing else. Along a Morton
/// curve it was worth a third as much.
///
/// Such spawns do not depend on each other, so no result tells in which order they were applied. Returns each of
/// `spawns` once, in the memory of `scratch`, which grows to the most spawns of a cut.
std::span<const PositionedSpawn> order_by_position(std::span<const Request> spawns, const geometry::FixedSpace& space,
                                                   std::vector<PositionedSpawn>& scratch);

}  // namespace ringfence::nodes
