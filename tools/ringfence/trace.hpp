#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "worlds/motion_file.hpp"
#include "worlds/scene.hpp"

namespace ringfence::tools {

/// Recorded position of an object in a frame.
struct Sample {
  std::uint32_t frame = 0;
  Vec3d position;
};

/// Recorded tracks by name of the object, each sorted by frame.
struct Trace {
  std::map<std::string, std::vector<Sample>> tracks;
  worlds::NamedShape shape;
  std::string contact_label;      ///< Scene::contact_label
  std::uint32_t longest_gap = 1;  ///< frames between two samples; shorter gaps are interpolated linearly
  double step = 0.001;            ///< positions are rounded to multiples of this length, metres
  double margin = 1;              ///< of the world's bounds around the recorded positions, metres
};

/// A scene and its motion.
struct TraceWorld {
  worlds::Scene scene;
  worlds::Motion motion;
};
/// Makes a world of `copies` of the trace side by side. Each copy starts a few frames later than the one before.
TraceWorld make_trace_world(const Trace& trace, std::uint32_t copies);

/// Parse a trace; see convert() for the formats. `name` is the file name in messages. Throw InputError for invalid
/// text, and Error for an invalid `from` or an empty time range. `minutes` 0: until the end of the trace.
Trace read_air(std::string_view text, const std::string& name, const std::string& from, std::uint32_t minutes);
Trace read_crowd(std::string_view text, const std::string& name);

}  // namespace ringfence::tools
