#include "picture/picture_file.hpp"

#include "picture/png.hpp"
#include "picture/svg.hpp"
#include "picture/world_picture.hpp"

namespace ringfence::tools {

bool PictureFile::is_supported(const std::string& path) { return path.ends_with(".svg") || path.ends_with(".png"); }

PictureFile::PictureFile(const std::string& path, PictureColors colors)
    : file_(path), colors_(colors), png_(path.ends_with(".png")) {}

void PictureFile::write(const World& world, const std::string& contact) {
  const Drawing drawing = draw_world(world, contact);
  file_.write(png_ ? to_png(drawing, colors_) : to_svg(drawing, colors_));
  file_.close();
}

}  // namespace ringfence::tools
