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
  regions::CellBox reach[2];
  bool any[2] = {false, false};
};

/// All that user nodes read about others: the server's relay of active and non-active objects, and each user node's
/// own publication.
///
/// Threads: the facade changes entries only while no frame is under way; in a frame each writer writes its own entry
/// before it reports, and the others read it after the server has told them that the frame is detected.
struct Publications {
  regions::CellGrid grid;
  const geometry::FixedSpace* space = nullptr;
  Published server;
  std::vector<Published> users;  ///< by user number
};

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
    regions::CellBox& reach = own_.reach[frame_ & 1];
    bool& any = own_.any[frame_ & 1];
    std::uint32_t at[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      at[axis] = all_.grid.coordinate(point[axis], axis);
      const auto cell = static_cast<std::uint16_t>(at[axis]);
      reach.lower[axis] = any ? std::min(reach.lower[axis], cell) : cell;
      reach.upper[axis] = any ? std::max(reach.upper[axis], cell) : cell;
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
