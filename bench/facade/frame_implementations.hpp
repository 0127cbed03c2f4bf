#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "facade/recorded_world.hpp"

namespace ringfence::bench {

/// One way to compute a frame: the service, our plain loop, or a peer library.
struct Implementation {
  const char* name;
  bool threads;               ///< multi-threaded: reports wall time
  std::uint32_t max_objects;  ///< with more objects a frame takes seconds
  double allowed_difference;  ///< from our plain loop, as a share of the contacts
  std::unique_ptr<FrameTester> (*make)(const RecordedWorld& world);
};

/// All of them, without the peers whose packages are missing.
const std::vector<Implementation>& frame_implementations();

}  // namespace ringfence::bench
