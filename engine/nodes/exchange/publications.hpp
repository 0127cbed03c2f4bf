#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "link/publication.hpp"
#include "queries/recorded_frame.hpp"
#include "regions/region_map.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// A publication and the range of cells that contain its states. Readers skip a publication whose range does not touch
/// their cells.
struct Published {
  link::Publication* publication = nullptr;  ///< null: unused entry
  regions::CellBox cell_range[2];            ///< by parity of the frame
  bool any[2] = {false, false};              ///< by parity of the frame: whether there is any state
};

/// The publication, for the user nodes, of the objects that a CD node in the server's process hosts, or all user nodes
/// of a thread.
///
/// Threads: the server writes `wanted` before it starts the frame. The host writes the rest before it sends
/// `published`. From then on the server decides whether the publication is valid (Publications::relays). A CD node that
/// is lost before it has sent `published` may write as long as its thread runs, but its publication is not read. One
/// that is lost later has finished writing, and is never started again. A user thread that was abandoned does not
/// write; the thread that replaces it continues.
struct HostPublication {
  /// Reserves for `states` states in the cells of `grid`. `kept_frames` as in Publication.
  HostPublication(const regions::CellGrid& grid, std::size_t states, std::size_t kept_frames = 2)
      : publication(grid.cells(), states, {grid.log2[0], grid.log2[1]}, kept_frames) {
    published.publication = &publication;
  }
  HostPublication(const HostPublication&) = delete;
  HostPublication& operator=(const HostPublication&) = delete;
  link::Publication publication;
  Published published;
  bool wanted = false;  ///< of a CD node: set if the publication is read in this frame
};

/// All publications that user nodes read. The user nodes of each thread publish the objects that they host. The server,
/// or the CD nodes that host them, publish the other active and non-active objects.
///
/// Threads: in a frame each writer writes its own publication before it reports, and the others read it after the
/// server has sent read_publications.
struct Publications {
  regions::CellGrid grid;
  const geometry::FixedSpace* space = nullptr;
  Published server;  ///< the objects that no CD node publishes
  /// By parity of the frame: the valid publications. Each object is in exactly one of them. The server lists them
  /// before it sends read_publications. They do not change after that, even if nodes are lost, and stay readable until
  /// the next frame is complete.
  std::vector<const Published*> relays[2];
  /// Frame k-1 for the models that ask queries in frame k; null: none. The facade sets it while no frame is running,
  /// and keeps the frame until the threads of user nodes that are late and of CD nodes that are lost in frame k have
  /// ended. A user node reads the pointer before its move begins.
  const queries::RecordedFrame* sensed = nullptr;

  /// The cell of a position.
  std::uint32_t cell_of(const Vec3d& position) const noexcept {
    std::uint32_t point[3];
    space->point(position, point);
    return grid.cell_of(point);
  }
};

/// Stores in `own` the cell range of its publication for `frame`. The cells must be numbered as in Publications::grid.
/// Called by the writer after it has published.
inline void note_cell_range(Published& own, std::uint64_t frame) noexcept {
  own.any[frame & 1] = !own.publication->states(frame).empty();
  const link::CellRange cell_range = own.any[frame & 1] ? own.publication->cell_range(frame) : link::CellRange{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    own.cell_range[frame & 1].lower[axis] = static_cast<std::uint16_t>(cell_range.lower[axis]);
    own.cell_range[frame & 1].upper[axis] = static_cast<std::uint16_t>(cell_range.upper[axis]);
  }
}

}  // namespace ringfence::nodes
