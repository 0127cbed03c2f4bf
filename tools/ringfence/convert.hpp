#pragma once

#include "options.hpp"

namespace ringfence::tools {

/// Turns a real trace into PREFIX.json and PREFIX.csv and says what is in them. Answers the exit code.
///
/// air: JSON rows of timestamp (ms), icao24, latitude, longitude (degrees), altitude (feet). An object is an aircraft,
/// a frame is 10 s; the plane is a Lambert conformal conic about the data (scale right to 0.1 %), the height is the
/// altitude. Its shape is a prism of 16 sides around the cylinder of its separation minima, 5 NM across and 1000 ft
/// high: a contact is a loss of separation.
/// crowd: lines of `id frame x/cm y/cm z/cm`, 25 frames a second; a person is an upright capsule.
///
/// Who is not heard for a few samples is interpolated (air 60 s, crowd 1 s); over longer gaps, before the first and
/// after the last sample it is absent. Throws InputError, Error.
int convert(const ConvertOptions& options);

}  // namespace ringfence::tools
