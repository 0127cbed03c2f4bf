#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Runs `ringfence convert`: converts a recorded trace into a scene (PREFIX.json) and its motion (PREFIX.csv), and
/// prints their sizes. Returns the exit code. Throws InputError and Error.
///
/// air: a JSON array of rows with timestamp (ms), icao24, latitude and longitude (degrees), and altitude (feet). An
/// object is an aircraft; a frame is 10 s. Positions are projected by a Lambert conformal conic around the data (scale
/// error at most 0.1 %); z is the altitude. The shape is a prism of 16 sides around the cylinder of the separation
/// minima, 5 NM across and 1000 ft high, so that a contact is a loss of separation.
///
/// crowd: lines of `id frame x/cm y/cm z/cm` at 25 frames per second. An object is a person, an upright capsule.
///
/// Gaps of up to 60 s (air) or 1 s (crowd) between two samples are interpolated. An object is absent in longer gaps,
/// before its first sample and after its last.
int convert(const ConvertOptions& options);

}  // namespace ringfence::tools
