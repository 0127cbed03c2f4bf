#include "mesh_file.hpp"

#include <bit>
#include <cstdint>
#include <cstring>
#include <system_error>

#include <fmt/format.h>

#include "mesh_answer.hpp"
#include "mesh_format.hpp"
#include "ringfence/error.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::tools {
namespace {

template <class T>
void put(std::string& to, T value) {
  static_assert(std::endian::native == std::endian::little);
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  to.append(bytes, sizeof(T));
}

}  // namespace

TriangleMesh parse_mesh(std::string_view bytes, const std::string& name, const std::filesystem::path& folder,
                        const ChildLimits& limits) {
  const auto refuse = [&](std::string_view why) { throw Error(fmt::format("{}: {}", name, why)); };
  if (mesh_extension(name).empty()) {
    refuse(fmt::format("found extension \"{}\"; expected .obj, .stl, .ply, .gltf, .glb or .3ds",
                       std::filesystem::path(name).extension().string()));
  }
  try {
    const ChildResult result =
        run_child(helper_program("ringfence-mesh-reader"), {name, folder.string()}, bytes, limits);
    if (!result.error.empty()) throw Error("its reader, assimp, " + result.error);
    return mesh_in(result.output);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", name, error.what()));
  }
}

TriangleMesh read_mesh(const std::filesystem::path& file) {
  // Report an unsupported extension even if there is no such file.
  if (mesh_extension(file).empty()) return parse_mesh({}, file.string());
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw Error(fmt::format("{}: {}", file.string(), error ? error.message() : std::string("not a file")));
  }
  const std::uintmax_t bytes = std::filesystem::file_size(file, error);
  if (error) throw Error(fmt::format("{}: {}", file.string(), error.message()));
  if (bytes > max_mesh_bytes)
    throw Error(fmt::format("{}: has {} bytes, more than {}", file.string(), bytes, max_mesh_bytes));
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  // Time and memory grow with the file: assimp reads about 20 MB of OBJ per second.
  ChildLimits limits;
  limits.cpu_seconds += static_cast<unsigned>(bytes >> 21);
  limits.memory_bytes += 32 * bytes;
  limits.wall_seconds = 10 * limits.cpu_seconds;
  // A million triangles have 48 MB; a vertex that no triangle uses has 12 bytes, and at least 6 in the file.
  limits.answer_bytes += 2 * bytes;
  return parse_mesh(worlds::read_text(file), file.string(), folder, limits);
}

void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh) {
  std::string text = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
      mesh.vertices.size(), mesh.indices.size() / 3);
  for (const Vec3f& v : mesh.vertices) put(text, v.x), put(text, v.y), put(text, v.z);
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    put(text, std::uint8_t{3});
    for (std::size_t k = 0; k < 3; ++k) put(text, mesh.indices[i + k]);
  }
  worlds::write_text(file, text);
}

}  // namespace ringfence::tools
