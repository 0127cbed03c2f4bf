// Property: any bytes as a mesh file (the first byte selects the format) are either refused with a message that begins
// with the file name, or give a mesh that passes describe_mesh_error, the same in a child process and in this one. A
// world accepts such a mesh or refuses it with an Error.
#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <string_view>

#include "fuzz/target.hpp"
#include "geometry/mesh.hpp"
#include "mesh_file.hpp"
#include "mesh_format.hpp"
#include "mesh_import.hpp"
#include "ringfence/error.hpp"

using namespace ringfence;

namespace {

constexpr std::array names{"fuzz.obj", "fuzz.stl", "fuzz.ply", "fuzz.gltf", "fuzz.glb", "fuzz.3ds"};
constexpr tools::ChildLimits limits{1, std::size_t{1} << 30};

bool same(const TriangleMesh& p, const TriangleMesh& q) {
  return p.indices == q.indices && p.vertices.size() == q.vertices.size() &&
         (p.vertices.empty() ||
          std::memcmp(p.vertices.data(), q.vertices.data(), p.vertices.size() * sizeof(Vec3f)) == 0);
}

void prepare(const TriangleMesh& mesh) {
  constexpr std::size_t max_indices = 20'000;  // larger meshes are slow and test nothing else
  if (mesh.indices.size() > max_indices) return;
  try {
    const geometry::Mesh prepared(mesh);
  } catch (const Error&) {
    // The surface has no area, or its extent is too large.
  }
}

}  // namespace

// assimp leaks a few bytes for some files that it refuses.
extern "C" const char* __lsan_default_suppressions();                                   // NOLINT
extern "C" const char* __lsan_default_suppressions() { return "leak:libassimp.so\n"; }  // NOLINT

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  if (size == 0) return 0;
  const std::string name = names[input[0] % names.size()];
  const std::string_view bytes(reinterpret_cast<const char*>(input + 1), size - 1);
  TriangleMesh mesh;
  try {
    mesh = tools::parse_mesh(bytes, name, {}, limits);
  } catch (const Error& error) {
    fuzz::require(std::string_view(error.what()).starts_with(name + ": "));
    return 0;
  }
  fuzz::require(tools::describe_mesh_error(mesh).empty());
  // The child process has survived this input. Run it here as well, so that the fuzzer measures its coverage.
  fuzz::require(same(mesh, tools::import_mesh(bytes, name, {})));
  prepare(mesh);
  return 0;
}
