#include "mesh_import.hpp"

#include <algorithm>
#include <array>
#include <charconv>
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

#include "mesh_format.hpp"
#include "ringfence/error.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::tools {
namespace {

/// Which of assimp's importers reads the files of an extension.
struct Format {
  const char* extension;
  const char* importer;
};
constexpr std::array formats{Format{".obj", "Wavefront Object Importer"},
                             Format{".stl", "Stereolithography (STL) Importer"},
                             Format{".ply", "Stanford Polygon Library (PLY) Importer"},
                             Format{".gltf", "glTF2 Importer"},
                             Format{".glb", "glTF2 Importer"},
                             Format{".3ds", "Discreet 3DS Importer"}};

/// Post-processing steps. None of them moves a vertex or reorders triangles.
constexpr unsigned post_processing = aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_RemoveComponent |
                                     aiProcess_PreTransformVertices | aiProcess_JoinIdenticalVertices;
constexpr int discarded_components = aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                                     aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                     aiComponent_TEXTURES | aiComponent_LIGHTS | aiComponent_CAMERAS |
                                     aiComponent_MATERIALS;

/// A block of memory that assimp reads as a file.
class MemoryStream final : public Assimp::IOStream {
 public:
  explicit MemoryStream(std::string_view bytes) : bytes_(bytes) {}
  size_t Read(void* to, size_t size, size_t count) override {
    if (size == 0) return 0;
    const std::size_t count_read = std::min(count, (bytes_.size() - at_) / size);
    if (count_read != 0) std::memcpy(to, bytes_.data() + at_, count_read * size);
    at_ += count_read * size;
    return count_read;
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

/// The files that assimp can open: the mesh file itself and, for glTF, the buffers in its folder.
class RestrictedFiles final : public Assimp::IOSystem {
 public:
  RestrictedFiles(std::string_view bytes, std::string name, std::filesystem::path folder)
      : bytes_(bytes), name_(std::move(name)), folder_(std::move(folder)) {}

  bool Exists(const char* file) const override { return file == name_ || !buffer_path(file).empty(); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (mode[0] != 'r') return nullptr;
    if (file == name_) return new MemoryStream(bytes_);
    const std::filesystem::path found = buffer_path(file);
    if (found.empty()) return nullptr;
    buffers_.push_back(worlds::read_text(found));
    return new MemoryStream(buffers_.back());
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  /// Path of a buffer that the mesh file names; empty if it may not be opened.
  std::filesystem::path buffer_path(const char* file) const {
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
  std::deque<std::string> buffers_;
};

void keep_only_importer(Assimp::Importer& importer, const char* name) {
  std::vector<std::unique_ptr<Assimp::BaseImporter>> others;
  for (std::size_t i = 0; i < importer.GetImporterCount(); ++i) {
    if (std::strcmp(importer.GetImporterInfo(i)->mName, name) != 0) others.emplace_back(importer.GetImporter(i));
  }
  for (const auto& other : others) importer.UnregisterLoader(other.get());
}

/// Checks the header of a PLY file. On invalid ones assimp searches for the end of the header without bound, and
/// allocates as many elements as the header declares.
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
    if (space == line.npos) return "has a PLY header in which an element has no count";
    const auto read = std::from_chars(line.data() + space, line.data() + line.size(), count);
    if (read.ec != std::errc()) return "has a PLY header in which an element has no count";
    // Each element takes at least one byte.
    if (count > text.size()) return fmt::format("declares {} elements in a file of {} bytes", count, text.size());
  }
  return "";
}

/// Checks the faces before post-processing: there assimp aborts on faces without vertices and reads vertices out of
/// range.
std::string describe_mesh_error(const aiScene& scene) {
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[m];
    if (part.mVertices == nullptr || (part.mNumFaces != 0 && part.mFaces == nullptr))
      return "has a mesh without vertices";
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
      const aiFace& face = part.mFaces[i];
      if (face.mNumIndices == 0 || face.mIndices == nullptr) return fmt::format("face {} has no vertices", i);
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        if (face.mIndices[k] < part.mNumVertices) continue;
        return fmt::format("face {} refers to vertex {} of {}", i, face.mIndices[k], part.mNumVertices);
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

TriangleMesh import_mesh(std::string_view bytes, const std::string& name, const std::filesystem::path& folder) {
  const std::string extension = mesh_extension(name);
  const auto format =
      std::find_if(formats.begin(), formats.end(), [&](const Format& f) { return extension == f.extension; });
  if (format == formats.end()) throw Error("is not a mesh file");
  if (bytes.size() > max_mesh_bytes)
    throw Error(fmt::format("has {} bytes, more than {}", bytes.size(), max_mesh_bytes));
  std::string error_text = extension == ".ply" ? describe_ply_error(bytes) : "";
  if (!error_text.empty()) throw Error(error_text);
  Assimp::Importer importer;
  keep_only_importer(importer, format->importer);
  // A name without a folder, so that assimp asks for buffers by the names that the file contains.
  const std::string alias = "mesh" + extension;
  const bool has_buffers = extension == ".gltf" || extension == ".glb";
  importer.SetIOHandler(new RestrictedFiles(bytes, alias, has_buffers ? folder : std::filesystem::path()));
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, discarded_components);
  const aiScene* scene = importer.ReadFile(alias, 0);
  if (scene != nullptr) error_text = describe_mesh_error(*scene);
  if (!error_text.empty()) throw Error(error_text);
  if (scene != nullptr) scene = importer.ApplyPostProcessing(post_processing);
  if (scene == nullptr) throw Error(importer.GetErrorString());
  TriangleMesh mesh;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) append(*scene->mMeshes[i], mesh);
  if (extension == ".3ds") {
    // assimp rotates the up-axis of 3DS from z to y; rotate it back.
    for (Vec3f& v : mesh.vertices) v = {v.x, -v.z, v.y};
  }
  return mesh;
}

}  // namespace ringfence::tools
