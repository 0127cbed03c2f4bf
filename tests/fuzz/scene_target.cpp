// Property: any text as a scene file is either refused with a message that begins with the file name, or is a scene
// that is the same after it is written and read again.
#include <string>
#include <string_view>

#include "fuzz/target.hpp"
#include "worlds/scene_file.hpp"

using namespace ringfence;

namespace {

constexpr const char* name = "fuzz.json";

TriangleMesh load_no_mesh(const std::filesystem::path& file) {
  throw worlds::InputError(file.string() + ": no meshes");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(input), size);
  try {
    const std::string once = worlds::format_scene(worlds::parse_scene(text, name, {}, load_no_mesh));
    const std::string twice = worlds::format_scene(worlds::parse_scene(once, name, {}, load_no_mesh));
    fuzz::require(once == twice);
  } catch (const worlds::InputError& error) {
    fuzz::require(std::string_view(error.what()).starts_with(name));
  }
  return 0;
}
