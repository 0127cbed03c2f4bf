#pragma once

#include <string>

#include "picture/drawing.hpp"
#include "picture/palette.hpp"

namespace ringfence::tools {

/// The text of an SVG file. Coordinates are rounded to tenths of a pixel. A pure function of its arguments.
///
/// Colours are in a style sheet. With PictureColors::automatic it has both sets, and the reader's system selects one.
std::string to_svg(const Drawing& drawing, PictureColors colors);

}  // namespace ringfence::tools
