#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/system_vector.hpp"
#include "geometry/bounds.hpp"
#include "nodes/server/objects/restored_object.hpp"
#include "nodes/server/request.hpp"

namespace ringfence::nodes {

struct PositionedSpawn {
  std::uint64_t place;     ///< row in which it stands, then position along the row
  std::uint32_t position;  ///< in the list of spawns
};

/// Order in which objects spawned at one cut get their slots: by position, in rows along x, like the order of the
/// sweep. So the rows, states, bodies and contacts of neighbouring objects are close in memory, on the server and on
/// every host; only objects that move far lose this. An order along a Morton curve gained a third as much.
///
/// The spawns are independent, so results do not depend on their order. Returns each of `spawns` once, in the memory of
/// `scratch`, which grows to the largest number of spawns in a cut.
std::span<const PositionedSpawn> order_by_position(std::span<const Request> spawns, const geometry::FixedSpace& space,
                                                   base::SystemVector<PositionedSpawn>& scratch);
/// The same for objects that are restored.
std::span<const PositionedSpawn> order_by_position(std::span<const RestoredObject> objects,
                                                   const geometry::FixedSpace& space,
                                                   base::SystemVector<PositionedSpawn>& scratch);

}  // namespace ringfence::nodes
