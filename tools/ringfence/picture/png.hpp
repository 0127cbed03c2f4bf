#pragma once

#include <string>

#include "picture/drawing.hpp"
#include "picture/palette.hpp"

namespace ringfence::tools {

/// The bytes of a PNG file with two pixels for each pixel of the drawing. Drawn by cairo; PictureColors::automatic is
/// light. Throws IncompleteError if cairo fails, for example because the memory does not suffice.
std::string to_png(const Drawing& drawing, PictureColors colors);

}  // namespace ringfence::tools
