#include "mesh_format.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

namespace ringfence::tools {
namespace {

constexpr std::array<std::string_view, 6> extensions{".obj", ".stl", ".ply", ".gltf", ".glb", ".3ds"};
constexpr std::size_t max_triangles = 1'000'000;

}  // namespace

std::string mesh_extension(const std::filesystem::path& name) {
  std::string extension = name.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(extensions.begin(), extensions.end(), extension) == extensions.end() ? "" : extension;
}

std::string describe_mesh_error(const TriangleMesh& mesh) {
  if (mesh.indices.empty()) return "has no triangles";
  if (mesh.indices.size() % 3 != 0) return "has a triangle without three vertices";
  if (mesh.indices.size() / 3 > max_triangles) {
    return fmt::format("has {} triangles; expected at most {}; split it into several shapes", mesh.indices.size() / 3,
                       max_triangles);
  }
  for (const std::uint32_t index : mesh.indices) {
    if (index >= mesh.vertices.size()) return fmt::format("refers to vertex {} of {}", index, mesh.vertices.size());
  }
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Vec3f& v = mesh.vertices[i];
    if (std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z)) continue;
    return fmt::format("vertex {} is ({}, {}, {}); expected finite coordinates", i, v.x, v.y, v.z);
  }
  return "";
}

}  // namespace ringfence::tools
