#include "picture/picture_file.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include "child_process.hpp"
#include "exit_code.hpp"
#include "picture/png.hpp"
#include "picture/svg.hpp"
#include "picture/world_picture.hpp"

namespace ringfence::tools {
namespace {

std::string to_png(const Drawing& drawing, PictureColors colors) {
  void* const library = dlopen(helper_program("png.so").c_str(), RTLD_NOW | RTLD_LOCAL);
  const auto draw =
      library ? reinterpret_cast<decltype(&ringfence_to_png)>(dlsym(library, "ringfence_to_png")) : nullptr;
  if (draw == nullptr) throw IncompleteError(fmt::format("picture: cannot be drawn: {}", dlerror()));
  std::string bytes;
  draw(drawing, colors, bytes);
  return bytes;
}

}  // namespace

bool PictureFile::is_supported(const std::string& path) { return path.ends_with(".svg") || path.ends_with(".png"); }

PictureFile::PictureFile(const std::string& path, PictureColors colors)
    : file_(path), colors_(colors), png_(path.ends_with(".png")) {}

void PictureFile::write(const World& world, const std::string& contact) {
  const Drawing drawing = draw_world(world, contact);
  file_.write(png_ ? to_png(drawing, colors_) : to_svg(drawing, colors_));
  file_.close();
}

}  // namespace ringfence::tools
