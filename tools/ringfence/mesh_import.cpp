#include "mesh_import.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <deque>
#include <memory>
#include <vector>

#include <assimp/BaseImporter.h>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/importerdesc.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include "ringfence/error.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::tools {
namespace {

struct Format {
  const char* ending;
  const char* importer;  ///< assimp's name for it
};
constexpr std::array formats{Format{".obj", "Wavefront Object Importer"},
                             Format{".stl", "Stereolithography (STL) Importer"},
                             Format{".ply", "Stanford Polygon Library (PLY) Importer"},
                             Format{".gltf", "glTF2 Importer"},
                             Format{".glb", "glTF2 Importer"},
                             Format{".3ds", "Discreet 3DS Importer"}};

constexpr std::size_t max_triangles = 1'000'000;

/// What assimp may do and no more: nothing that moves a corner or reorders triangles.
constexpr unsigned steps = aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_RemoveComponent |
                           aiProcess_PreTransformVertices | aiProcess_JoinIdenticalVertices;
constexpr int discarded_components = aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                                     aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                     aiComponent_TEXTURES | aiComponent_LIGHTS | aiComponent_CAMERAS |
                                     aiComponent_MATERIALS;

/// Bytes that are there already, as a file that assimp reads.
class Bytes final : public Assimp::IOStream {
 public:
  explicit Bytes(std::string_view bytes) : bytes_(bytes) {}
  size_t Read(void* to, size_t size, size_t count) override {
    if (size == 0) return 0;
    const std::size_t whole = std::min(count, (bytes_.size() - at_) / size);
    if (whole != 0) std::memcpy(to, bytes_.data() + at_, whole * size);
    at_ += whole * size;
    return whole;
  }
  size_t Write(const void*, size_t, size_t) override { return 0; }
  aiReturn Seek(size_t offset, aiOrigin from) override {
    const std::size_t base = from == aiOrigin_SET ? 0 : from == aiOrigin_CUR ? at_ : bytes_.size();
    if (offset > bytes_.size() - base) return aiReturn_FAILURE;
    at_ = base + offset;
    return aiReturn_SUCCESS;
  }
  size_t Tell() const override { return at_; }
  size_t FileSize() const override { return bytes_.size(); }
  void Flush() override {}

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
};

/// All files that there are for assimp: the one that is read, and for glTF what lies in its folder.
class Files final : public Assimp::IOSystem {
 public:
  Files(std::string_view bytes, std::string name, std::filesystem::path folder)
      : bytes_(bytes), name_(std::move(name)), folder_(std::move(folder)) {}

  bool Exists(const char* file) const override { return file == name_ || !part(file).empty(); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (mode[0] != 'r') return nullptr;
    if (file == name_) return new Bytes(bytes_);
    const std::filesystem::path found = part(file);
    if (found.empty()) return nullptr;
    parts_.push_back(worlds::read_text(found));
    return new Bytes(parts_.back());
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  /// Where a part lies that the file names; empty where it may name none such.
  std::filesystem::path part(const char* file) const {
    if (folder_.empty()) return {};
    const std::filesystem::path named = std::filesystem::path(file).lexically_normal();
    if (named.empty() || named.is_absolute() || *named.begin() == "..") return {};
    std::error_code error;
    const std::filesystem::path found = folder_ / named;
    if (!std::filesystem::is_regular_file(found, error)) return {};
    return std::filesystem::file_size(found, error) <= max_mesh_bytes && !error ? found : std::filesystem::path();
  }

  std::string_view bytes_;
  std::string name_;
  std::filesystem::path folder_;
  std::deque<std::string> parts_;
};

void keep_only_importer(Assimp::Importer& importer, const char* name) {
  std::vector<std::unique_ptr<Assimp::BaseImporter>> others;
  for (std::size_t i = 0; i < importer.GetImporterCount(); ++i) {
    if (std::strcmp(importer.GetImporterInfo(i)->mName, name) != 0) others.emplace_back(importer.GetImporter(i));
  }
  for (const auto& other : others) importer.UnregisterLoader(other.get());
}

/// assimp searches a PLY file for a line that ends its header for ever, and makes room for whatever number of elements
/// that promises.
std::string describe_ply_error(std::string_view text) {
  constexpr std::string_view element = "element ";
  constexpr std::string_view last = "\nend_header";
  const std::string_view start = text.substr(0, 65536);
  const std::size_t end = start.find(last);
  const std::string_view after = start.substr(end == start.npos ? start.size() : end + last.size(), 1);
  if (!text.starts_with("ply") || (after != "\n" && after != "\r")) return "has no PLY header";
  const std::string_view header = text.substr(0, end);
  for (std::size_t at = 0; (at = header.find(element, at)) != header.npos;) {
    at += element.size();
    const std::string_view line = header.substr(at, header.find('\n', at) - at);
    const std::size_t space = line.find_first_not_of(" \t", std::min(line.size(), line.find_first_of(" \t")));
    std::uint64_t count = 0;
    if (space == line.npos) return "has a PLY header with an element without a number";
    const auto read = std::from_chars(line.data() + space, line.data() + line.size(), count);
    if (read.ec != std::errc()) return "has a PLY header with an element without a number";
    // Every element takes a byte at least.
    if (count > text.size()) return fmt::format("is to have {} elements of a kind in {} bytes", count, text.size());
  }
  return "";
}

/// assimp stops the program at faces without corners, and follows corners that are not there.
std::string describe_mesh_error(const aiScene& scene) {
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[m];
    if (part.mVertices == nullptr || (part.mNumFaces != 0 && part.mFaces == nullptr))
      return "has a part without corners";
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
      const aiFace& face = part.mFaces[i];
      if (face.mNumIndices == 0 || face.mIndices == nullptr) return fmt::format("face {} has no corners", i);
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        if (face.mIndices[k] < part.mNumVertices) continue;
        return fmt::format("face {} names corner {} of {}", i, face.mIndices[k], part.mNumVertices);
      }
    }
  }
  return "";
}

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

}  // namespace

std::string mesh_extension(const std::filesystem::path& name) {
  std::string ending = name.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const auto known = std::find_if(formats.begin(), formats.end(), [&](const Format& f) { return ending == f.ending; });
  return known == formats.end() ? "" : ending;
}

TriangleMesh import_mesh(std::string_view bytes, const std::string& name, const std::filesystem::path& folder) {
  const std::string ending = mesh_extension(name);
  const auto format = std::find_if(formats.begin(), formats.end(), [&](const Format& f) { return ending == f.ending; });
  if (format == formats.end()) throw Error("is no mesh file");
  if (bytes.size() > max_mesh_bytes)
    throw Error(fmt::format("has {} bytes, more than {}", bytes.size(), max_mesh_bytes));
  std::string error_text = ending == ".ply" ? describe_ply_error(bytes) : "";
  if (!error_text.empty()) throw Error(error_text);
  Assimp::Importer importer;
  keep_only_importer(importer, format->importer);
  // In no folder, so that assimp asks for parts by the names that the file gives them.
  const std::string alias = "mesh" + ending;
  const bool in_parts = ending == ".gltf" || ending == ".glb";
  importer.SetIOHandler(new Files(bytes, alias, in_parts ? folder : std::filesystem::path()));
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, discarded_components);
  const aiScene* scene = importer.ReadFile(alias, 0);
  if (scene != nullptr) error_text = describe_mesh_error(*scene);
  if (!error_text.empty()) throw Error(error_text);
  if (scene != nullptr) scene = importer.ApplyPostProcessing(steps);
  if (scene == nullptr) throw Error(importer.GetErrorString());
  TriangleMesh mesh;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) append(*scene->mMeshes[i], mesh);
  if (ending == ".3ds") {
    // assimp turns what 3DS calls up from z to y.
    for (Vec3f& v : mesh.vertices) v = {v.x, -v.z, v.y};
  }
  return mesh;
}

std::string describe_mesh_error(const TriangleMesh& mesh) {
  if (mesh.indices.empty()) return "has no triangles";
  if (mesh.indices.size() % 3 != 0) return "has a triangle without three corners";
  if (mesh.indices.size() / 3 > max_triangles) {
    return fmt::format("has {} triangles; at most {} make a shape: cut it in several", mesh.indices.size() / 3,
                       max_triangles);
  }
  for (const std::uint32_t index : mesh.indices) {
    if (index >= mesh.vertices.size()) return fmt::format("names corner {} of {}", index, mesh.vertices.size());
  }
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Vec3f& v = mesh.vertices[i];
    if (std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z)) continue;
    return fmt::format("corner {} lies at ({}, {}, {}), which is no place", i, v.x, v.y, v.z);
  }
  return "";
}

}  // namespace ringfence::tools
