#pragma once

#include <string>

#include "picture/drawing.hpp"
#include "picture/palette.hpp"

/// Appends to `bytes` a PNG file with two pixels for each pixel of the drawing. Drawn by cairo;
/// PictureColors::automatic is light. Throws IncompleteError if cairo fails, for example because the memory does not
/// suffice.
///
/// In a shared object, libexec/ringfence/png.so, which is loaded before a run that writes such a picture.
extern "C" void ringfence_to_png(const ringfence::tools::Drawing& drawing, ringfence::tools::PictureColors colors,
                                 std::string& bytes);
