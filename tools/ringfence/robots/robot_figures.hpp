#pragma once

#include <cstdint>
#include <vector>

namespace ringfence::tools {

/// Figures of all robots of a process.
struct RobotFigures {
  std::uint64_t connected = 0;  ///< robots that were welcomed
  std::uint64_t updates = 0, bytes = 0;
  std::uint64_t complete = 0;                ///< updates with the whole state
  std::uint64_t skipped = 0;                 ///< frames without an update, between two updates
  std::uint64_t ignored = 0;                 ///< updates that came too late
  std::uint64_t objects = 0;                 ///< sum over the updates of the objects that are near
  std::vector<std::uint32_t> effect_frames;  ///< [n]: inputs that took effect n frames after they were sent
  std::vector<std::uint32_t> effect_ms;      ///< [n]: whose effect was received n tenths of a millisecond after that
  std::vector<double>
      round_trip_ms;  ///< from an input to the first update that echoes it, without the time at the gateway
  std::vector<double> prediction_m;  ///< between the predicted position of an avatar and the one of the update
  std::vector<double> display_ms;    ///< by which others are displayed later than the fastest update arrives
  std::uint64_t late = 0;            ///< updates of a time that had been displayed before
};

/// Of the time in which all of them walk.
struct RobotInterval {
  double seconds = 0, cpu_s = 0;
  std::uint64_t updates = 0, bytes = 0, objects = 0;  ///< of RobotFigures
};

}  // namespace ringfence::tools
