#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "worlds/motion_file.hpp"
#include "worlds/scene.hpp"

namespace ringfence::tools {

/// Where something was in a frame.
struct Sample {
  std::uint32_t frame = 0;
  Vec3d position;
};

/// Recorded tracks, each in order of frame, by who was recorded.
struct Trace {
  std::map<std::string, std::vector<Sample>> tracks;
  worlds::NamedShape shape;
  std::uint32_t longest_gap = 1;  ///< frames between two samples that are still filled in by a straight line
  double step = 0.001;            ///< positions are rounded to multiples of it, metres
  double margin = 1;              ///< around what is recorded, metres
};

/// A world of `copies` of the trace side by side, each a few frames later than the one before.
struct TraceWorld {
  worlds::Scene scene;
  worlds::Motion motion;
};
TraceWorld make_trace_world(const Trace& trace, std::uint32_t copies);

/// Readers; `name` stands for the file in messages. Throw InputError.
Trace read_air(std::string_view text, const std::string& name, const std::string& from, std::uint32_t minutes);
Trace read_crowd(std::string_view text, const std::string& name);

}  // namespace ringfence::tools
