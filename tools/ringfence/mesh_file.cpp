#include "mesh_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>

#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include "ringfence/error.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::tools {
namespace {

constexpr std::array endings{".obj", ".stl", ".ply", ".gltf", ".glb", ".3ds"};

/// What assimp may do and no more: nothing that moves a corner or reorders triangles.
constexpr unsigned steps = aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_RemoveComponent |
                           aiProcess_PreTransformVertices | aiProcess_JoinIdenticalVertices;
constexpr int not_geometry = aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                             aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                             aiComponent_TEXTURES | aiComponent_LIGHTS | aiComponent_CAMERAS | aiComponent_MATERIALS;

void append(const aiMesh& part, TriangleMesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    mesh.vertices.push_back({part.mVertices[i].x, part.mVertices[i].y, part.mVertices[i].z});
  }
  for (unsigned i = 0; i < part.mNumFaces; ++i) {
    const aiFace& face = part.mFaces[i];
    if (face.mNumIndices != 3) continue;
    for (unsigned k = 0; k < 3; ++k) mesh.indices.push_back(first + face.mIndices[k]);
  }
}

/// assimp searches a PLY file for the end of its header for ever, and stops the program at faces without corners.
std::string flaw_of_text(const std::filesystem::path& file, const std::string& ending) {
  if (ending != ".ply") return "";
  const std::string text = worlds::read_text(file);
  const bool whole = text.starts_with("ply") && std::string_view(text).substr(0, 65536).find("end_header") != text.npos;
  return whole ? "" : "has no PLY header";
}

std::string flaw_of(const aiScene& scene) {
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[m];
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
      const aiFace& face = part.mFaces[i];
      if (face.mNumIndices == 0) return fmt::format("face {} has no corners", i);
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        if (face.mIndices[k] < part.mNumVertices) continue;
        return fmt::format("face {} names corner {} of {}", i, face.mIndices[k], part.mNumVertices);
      }
    }
  }
  return "";
}

template <class T>
void put(std::string& to, T value) {
  static_assert(std::endian::native == std::endian::little);
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  to.append(bytes, sizeof(T));
}

}  // namespace

TriangleMesh read_mesh(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (std::find(endings.begin(), endings.end(), ending) == endings.end()) {
    throw Error(fmt::format("{}: ends in \"{}\"; expected .obj, .stl, .ply, .gltf, .glb or .3ds", file.string(),
                            file.extension().string()));
  }
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw Error(fmt::format("{}: {}", file.string(), error ? error.message() : std::string("not a file")));
  }
  Assimp::Importer importer;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, not_geometry);
  std::string flaw = flaw_of_text(file, ending);
  const aiScene* scene = flaw.empty() ? importer.ReadFile(file.string(), 0) : nullptr;
  if (scene != nullptr) flaw = flaw_of(*scene);
  if (scene != nullptr && flaw.empty()) scene = importer.ApplyPostProcessing(steps);
  if (!flaw.empty()) throw Error(fmt::format("{}: {}", file.string(), flaw));
  if (scene == nullptr) throw Error(fmt::format("{}: {}", file.string(), importer.GetErrorString()));
  TriangleMesh mesh;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) append(*scene->mMeshes[i], mesh);
  if (ending == ".3ds") {
    // assimp turns what 3DS calls up from z to y.
    for (Vec3f& v : mesh.vertices) v = {v.x, -v.z, v.y};
  }
  if (mesh.indices.empty()) throw Error(fmt::format("{}: has no triangles", file.string()));
  return mesh;
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
