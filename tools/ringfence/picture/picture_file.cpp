#include "picture/picture_file.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include "child_process.hpp"
#include "picture/svg.hpp"
#include "picture/world_picture.hpp"
#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

decltype(&ringfence_to_png) load_png() {
  void* const library = dlopen(helper_program("png.so").c_str(), RTLD_NOW | RTLD_LOCAL);
  const auto draw =
      library ? reinterpret_cast<decltype(&ringfence_to_png)>(dlsym(library, "ringfence_to_png")) : nullptr;
  if (draw == nullptr) throw Error(fmt::format("--picture: cannot draw PNG: {}", dlerror()));
  return draw;
}

}  // namespace

bool PictureFile::is_supported(const std::string& path) { return path.ends_with(".svg") || path.ends_with(".png"); }

PictureFile::PictureFile(const std::string& path, PictureColors colors)
    : to_png_(path.ends_with(".png") ? load_png() : nullptr), file_(path), colors_(colors) {}

void PictureFile::write(const World& world, const std::string& contact) {
  const Drawing drawing = draw_world(world, contact);
  std::string bytes;
  if (to_png_ != nullptr) {
    to_png_(drawing, colors_, bytes);
  } else {
    bytes = to_svg(drawing, colors_);
  }
  file_.write(bytes);
  file_.close();
}

}  // namespace ringfence::tools
