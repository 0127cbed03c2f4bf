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
  /// Of a user node, by parity of the frame: all its states, so that a reader of the only cell does not have to search.
  std::span<const link::PublishedState> states[2];
};

/// The publication, for the user nodes, of the objects that a CD node in the server's process hosts.
///
/// Threads: the server writes `wanted` before it starts the frame. The node writes the rest before it sends
/// `published`. From then on the server decides whether the publication is valid (Publications::relays). A node that is
/// lost before it has sent `published` may write as long as its thread runs, but its publication is not read. A node
/// that is lost later has finished writing, and is never started again.
struct NodePublication {
  /// Reserves for `states` states in the cells of `grid`.
  NodePublication(const regions::CellGrid& grid, std::size_t states)
      : publication(grid.cells(), states, {grid.log2[0], grid.log2[1]}) {
    published.publication = &publication;
  }
  NodePublication(const NodePublication&) = delete;
  NodePublication& operator=(const NodePublication&) = delete;
  link::Publication publication;
  Published published;
  bool wanted = false;  ///< set if the publication is read in this frame
};

/// Where the user nodes have published states in a frame.
struct UserIndex {
  /// Cell and user, ascending: one entry for each cell in which a user node has states. See base::PairSort::key().
  std::vector<std::uint64_t> entries;
  /// By block of 2^block_log2 cells with consecutive numbers: the position of its first entry. One more for the end.
  std::vector<std::uint32_t> block_starts;
  unsigned block_log2 = 0;
  /// Those with states in many cells, which have no entry; a limited number.
  std::vector<UserNumber> wide;

  /// The position of the first entry whose cell is not below `cell`. There are about as many blocks as entries, so the
  /// search is short unless a block is crowded.
  std::size_t find(std::uint32_t cell) const noexcept {
    const std::size_t block = cell >> block_log2;
    const auto at = [this](std::uint32_t position) { return entries.begin() + position; };
    const auto found =
        std::lower_bound(at(block_starts[block]), at(block_starts[block + 1]), std::uint64_t{cell} << 32);
    return static_cast<std::size_t>(found - entries.begin());
  }

  static UserNumber user_of(std::uint64_t entry) noexcept { return static_cast<UserNumber>(entry); }
  static std::uint32_t cell_of(std::uint64_t entry) noexcept { return static_cast<std::uint32_t>(entry >> 32); }
};

/// All publications that user nodes read. Each user node publishes the objects that it hosts. The server, or the CD
/// nodes that host them, publish the other active and non-active objects.
///
/// Threads: the facade changes entries while no frame is running. In a frame each writer writes its own entry before it
/// reports, and the others read it after the server has sent read_publications. The exception is a user node whose
/// thread was abandoned: its thread no longer writes the entry, and the facade clears it before read_publications.
struct Publications {
  regions::CellGrid grid;
  const geometry::FixedSpace* space = nullptr;
  Published server;  ///< the objects that no CD node publishes
  /// By parity of the frame: the valid publications. Each object is in exactly one of them. The server lists them
  /// before it sends read_publications. They do not change after that, even if nodes are lost, and stay readable until
  /// the next frame is complete.
  std::vector<const Published*> relays[2];
  std::vector<Published> users;  ///< by user number
  UserIndex user_index[2];       ///< of `users`, by parity of the frame; under the same contract as `relays`
  /// Frame k-1 for the models that ask queries in frame k; null: none. The facade sets it while no frame is running,
  /// and keeps the frame until the threads of user nodes that are late and of CD nodes that are lost in frame k have
  /// ended. A user node reads the pointer before its move begins.
  const queries::RecordedFrame* sensed = nullptr;
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

/// Fills one publication for one frame and stores its cell range. Belongs to the writer of `own`; `all` and `own`
/// outlive it.
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
  /// Makes the states visible to readers and returns their number. Call it once, after the last add().
  std::uint64_t publish() {
    own_.publication->publish();
    own_.states[frame_ & 1] = own_.publication->states(frame_);
    return count_;
  }

 private:
  Publications& all_;
  Published& own_;
  std::uint64_t frame_;
  std::uint64_t count_ = 0;
};

}  // namespace ringfence::nodes
