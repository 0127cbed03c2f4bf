#include "mesh_file.hpp"

#include <bit>
#include <cstdint>
#include <cstring>
#include <system_error>

#include <fmt/format.h>

#include "mesh_import.hpp"
#include "ringfence/error.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::tools {
namespace {

// First byte of the child's output.
constexpr char mesh_tag = 'm', error_tag = 'r';

template <class T>
void put(std::string& to, T value) {
  static_assert(std::endian::native == std::endian::little);
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  to.append(bytes, sizeof(T));
}

template <class T>
void put_all(std::string& to, const std::vector<T>& values) {
  put(to, std::uint64_t{values.size()});
  to.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// Reads what put_all wrote and removes it from `from`. False if `from` is too short.
template <class T>
bool take_all(std::string_view& from, std::vector<T>& values) {
  std::uint64_t count = 0;
  if (from.size() < sizeof count) return false;
  std::memcpy(&count, from.data(), sizeof count);
  from.remove_prefix(sizeof count);
  if (count > from.size() / sizeof(T)) return false;
  values.resize(count);
  if (count != 0) std::memcpy(values.data(), from.data(), count * sizeof(T));
  from.remove_prefix(count * sizeof(T));
  return true;
}

/// Runs in the child: the mesh or an error message, as text.
std::string import_to_text(std::string_view bytes, const std::string& name, const std::filesystem::path& folder) {
  try {
    const TriangleMesh mesh = import_mesh(bytes, name, folder);
    // Check before sending: a small file can make a large mesh.
    const std::string error_text = describe_mesh_error(mesh);
    if (!error_text.empty()) return error_tag + error_text;
    std::string text(1, mesh_tag);
    put_all(text, mesh.vertices);
    put_all(text, mesh.indices);
    return text;
  } catch (const Error& error) {
    return std::string(1, error_tag) + error.what();
  }
}

}  // namespace

TriangleMesh parse_mesh(std::string_view bytes, const std::string& name, const std::filesystem::path& folder,
                        const ChildLimits& limits) {
  const auto refuse = [&](std::string_view why) { throw Error(fmt::format("{}: {}", name, why)); };
  if (mesh_extension(name).empty()) {
    refuse(fmt::format("found extension \"{}\"; expected .obj, .stl, .ply, .gltf, .glb or .3ds",
                       std::filesystem::path(name).extension().string()));
  }
  const ChildResult result = run_in_child([&] { return import_to_text(bytes, name, folder); }, limits);
  if (!result.error.empty()) refuse("its reader, assimp, " + result.error);
  std::string_view output = result.output;
  if (output.starts_with(error_tag)) refuse(output.substr(1));
  // Invalid input may have corrupted the memory of the child, so its result is checked again.
  TriangleMesh mesh;
  if (!output.starts_with(mesh_tag)) refuse("its reader, assimp, returned nothing");
  output.remove_prefix(1);
  if (!take_all(output, mesh.vertices) || !take_all(output, mesh.indices) || !output.empty())
    refuse("its reader, assimp, returned an incomplete mesh");
  const std::string error_text = describe_mesh_error(mesh);
  if (!error_text.empty()) refuse(error_text);
  return mesh;
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
