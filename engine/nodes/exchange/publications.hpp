#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/bounds.hpp"
#include "link/publication.hpp"
#include "regions/region_map.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// A publication and, by parity of the frame, which cells it says anything about: most can be passed over by that.
struct Published {
  link::Publication* publication = nullptr;  ///< null: nobody there
  regions::CellBox cell_range[2];
  bool any[2] = {false, false};
};

/// What a CD node in the server's process tells the user nodes of the objects that it hosts.
///
/// Threads: the server writes `wanted` before it lets the frame begin; the node writes the rest before it says so
/// (`published`), and what holds of it from then on is for the server to say (Publications::relays). A node that is
/// lost before it has said so may write as long as its thread lives, which nobody reads; one that is lost later has
/// said all, and does not write before it is told of another frame, which it is not.
struct NodePublication {
  NodePublication(const regions::CellGrid& grid, std::size_t states)
      : publication(grid.cells(), states, {grid.log2[0], grid.log2[1]}) {
    published.publication = &publication;
  }
  NodePublication(const NodePublication&) = delete;
  NodePublication& operator=(const NodePublication&) = delete;
  link::Publication publication;
  Published published;
  bool wanted = false;  ///< somebody reads it in this frame
};

/// All that user nodes read about others: the relay of active and non-active objects, by the server or the CD nodes
/// that host them, and each user node's own publication.
///
/// Threads: the facade changes entries only while no frame is under way; in a frame each writer writes its own entry
/// before it reports, and the others read it after the server has told them to look.
struct Publications {
  regions::CellGrid grid;
  const geometry::FixedSpace* space = nullptr;
  Published server;  ///< of what no CD node publishes
  /// By parity of the frame: those that hold, each object in one of them, as the server says before user nodes look.
  /// They stay as they are from then on, whoever is lost, and readable until the next frame is complete.
  std::vector<const Published*> relays[2];
  std::vector<Published> users;  ///< by user number
};

/// Notes the reach of a publication that has been published for `frame`, whose cells are laid out as the grid's.
void note_cell_range(Published& own, std::uint64_t frame) noexcept;

/// Fills one publication for one frame and notes its reach.
class PublicationWriter {
 public:
  PublicationWriter(Publications& all, Published& own, std::uint64_t frame) : all_(all), own_(own), frame_(frame) {
    own_.publication->begin(frame);
    own_.any[frame & 1] = false;
  }
  PublicationWriter(const PublicationWriter&) = delete;
  PublicationWriter& operator=(const PublicationWriter&) = delete;

  void add(ObjectNumber number, const Pose& pose) {
    std::uint32_t point[3];
    all_.space->point(pose.position, point);
    regions::CellBox& cell_range = own_.cell_range[frame_ & 1];
    bool& any = own_.any[frame_ & 1];
    std::uint32_t at[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      at[axis] = all_.grid.coordinate(point[axis], axis);
      const auto cell = static_cast<std::uint16_t>(at[axis]);
      cell_range.lower[axis] = any ? std::min(cell_range.lower[axis], cell) : cell;
      cell_range.upper[axis] = any ? std::max(cell_range.upper[axis], cell) : cell;
    }
    any = true;
    own_.publication->add(all_.grid.index(at[0], at[1], at[2]), {number, 0, pose});
    ++count_;
  }
  /// Shows it; returns the number of states.
  std::uint64_t publish() {
    own_.publication->publish();
    return count_;
  }

 private:
  Publications& all_;
  Published& own_;
  std::uint64_t frame_;
  std::uint64_t count_ = 0;
};

}  // namespace ringfence::nodes
