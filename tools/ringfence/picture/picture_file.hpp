#pragma once

#include <string>

#include "output_file.hpp"
#include "picture/palette.hpp"
#include "picture/png.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// --picture: a picture of the world after the last frame.
class PictureFile {
 public:
  /// Whether the name ends in an extension of a supported format: .svg or .png.
  static bool is_supported(const std::string& path);

  /// Opens the file and loads what draws a PNG picture, so that an invalid path and an incomplete installation are
  /// reported before the first frame. Throws Error if that fails. Precondition: is_supported(path).
  PictureFile(const std::string& path, PictureColors colors);

  /// Draws the world and closes the file. `contact` is what the legend calls the mark of a contact. Throws
  /// IncompleteError if that fails.
  void write(const World& world, const std::string& contact = "contact point");

 private:
  decltype(&ringfence_to_png) to_png_;  ///< null: an SVG picture
  OutputFile file_;
  PictureColors colors_;
};

}  // namespace ringfence::tools
