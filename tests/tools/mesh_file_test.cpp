#include "mesh_file.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "ringfence/error.hpp"
#include "tools/program.hpp"
#include "worlds/asteroid.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::TemporaryFolder;

const std::string meshes = RINGFENCE_MESHES;

/// The triangles of a mesh in a canonical order: each is rotated so that its smallest vertex is first, and all are
/// sorted. `raised` metres are subtracted from z.
std::vector<std::array<float, 9>> triangles_of(const TriangleMesh& mesh, float raised) {
  std::vector<std::array<float, 9>> out;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    std::array<std::array<float, 3>, 3> vertices;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f v = mesh.vertices[mesh.indices[i + k]];
      vertices[k] = {v.x, v.y, v.z - raised};
    }
    std::rotate(vertices.begin(), std::min_element(vertices.begin(), vertices.end()), vertices.end());
    std::array<float, 9> flat;
    for (std::size_t k = 0; k < 9; ++k) flat[k] = vertices[k / 3][k % 3];
    out.push_back(flat);
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::string error_message_of(const std::string& file) {
  try {
    tools::read_mesh(file);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// A scene of two objects with the mesh `file`. `motion` moves one of them into the other.
std::string scene_of(const std::string& file) {
  return R"({"format": "ringfence-scene", "version": 1, "bounds": {"min": [-5, -5, -5], "max": [5, 5, 5]},
 "shapes": {"rock": {"type": "mesh", "file": ")" +
         file + R"("}},
 "objects": [{"id": 1, "shape": "rock", "category": "active", "position": [0, 0, 0]},
             {"id": 2, "shape": "rock", "category": "active", "position": [3, 0, 0]}]})";
}
const char* const motion =
    "frame,object,x,y,z,qx,qy,qz,qw\n0,2,2,0,0,0,0,0,1\n1,2,0.5,0.1,0.1,0,0,0,1\n2,2,0.4,0.1,0.1,0,0,0,1\n";

}  // namespace

TEST_CASE("a tetrahedron is read from OBJ, STL, PLY, glTF and 3DS") {
  const TriangleMesh expected{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0.5f}}, {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3}};
  for (const char* extension : {"obj", "stl", "ply", "gltf", "3ds"}) {
    CAPTURE(extension);
    const TriangleMesh mesh = tools::read_mesh(meshes + "/tetrahedron." + extension);
    // The node of the glTF file raises the mesh by 2 m.
    const float raised = std::string(extension) == "gltf" ? 2.0f : 0.0f;
    CHECK(triangles_of(mesh, raised) == triangles_of(expected, 0));
    CHECK(mesh.vertices.size() == 4);
  }
}

TEST_CASE("the error message for an unreadable mesh file has its name and the reason") {
  const auto refused = [](const std::string& file, const std::string& why) {
    const std::string what = error_message_of(file);
    CHECK_MESSAGE(what.starts_with(file + ": "), what);
    CHECK_MESSAGE(what.find(why) != std::string::npos, what);
  };
  refused(meshes + "/none.obj", "o such file");
  refused(meshes + "/tetrahedron.blend", "expected .obj, .stl, .ply, .gltf, .glb or .3ds");
  refused(meshes, "expected .obj");
  refused(meshes + "/broken.ply", "has no PLY header");
  refused(meshes + "/cut.ply", "");
  refused(meshes + "/lines.obj", "");
}

TEST_CASE("a mesh file with infinite or missing vertices or too many triangles is refused") {
  const auto refused = [](const std::string& name, const std::string& text, const std::string& why) {
    try {
      tools::parse_mesh(text, name);
      FAIL_CHECK(name << " is accepted");
    } catch (const Error& error) {
      const std::string what = error.what();
      CHECK_MESSAGE(what.starts_with(name + ": "), what);
      CHECK_MESSAGE(what.find(why) != std::string::npos, what);
    }
  };
  refused("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "expected finite coordinates");
  refused("inf.obj", "v 0 0 0\nv 1e39 0 0\nv 0 1 0\nf 1 2 3\n", "expected finite coordinates");
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  refused("too_many_elements.ply", header, "declares 4000000000 elements");
  refused("endless.ply", header.substr(0, header.size() - 12) + " end_header\n", "has no PLY header");
  refused("uncounted.ply", "ply\nformat ascii 1.0\nelement vertex\nend_header\n", "has no count");
  std::string many = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < 1'000'001; ++i) many += "f 1 2 3\n";
  refused("many.obj", many, "has 1000001 triangles");
}

TEST_CASE("a mesh file that crashes assimp is refused, and the program continues") {
  // A cycle of nodes: assimp recurses until the stack overflows.
  const std::string cycle = R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
    "nodes": [{"children": [1]}, {"children": [0]}]})";
  try {
    tools::parse_mesh(cycle, "cycle.gltf");
    FAIL_CHECK("a cycle of nodes is accepted");
  } catch (const Error& error) {
    CHECK(std::string(error.what()).starts_with("cycle.gltf: "));
  }
}

TEST_CASE("a glTF file can use buffers in its folder and below, but not elsewhere") {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "scene/parts");
  std::string vertices;
  for (const float x : {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f}) {
    vertices.append(reinterpret_cast<const char*>(&x), sizeof x);
  }
  worlds::write_text(folder / "scene/parts/vertices.bin", vertices);
  worlds::write_text(folder / "vertices.bin", vertices);
  const auto triangles = [&](const std::string& uri) -> std::size_t {
    worlds::write_text(folder / "scene/t.gltf",
                       R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "buffers": [{"byteLength": 36, "uri": ")" +
                           uri + R"("}], "bufferViews": [{"buffer": 0, "byteLength": 36}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                     "min": [0, 0, 0], "max": [1, 1, 0]}]})");
    try {
      return tools::read_mesh(folder / "scene/t.gltf").indices.size() / 3;
    } catch (const Error&) {
      return 0;
    }
  };
  CHECK(triangles("parts/vertices.bin") == 1);
  CHECK(triangles("../vertices.bin") == 0);
  CHECK(triangles("parts/../../vertices.bin") == 0);
  CHECK(triangles(folder / "vertices.bin") == 0);
  CHECK(triangles("none.bin") == 0);
}

TEST_CASE("a written mesh reads back with the same bits") {
  const TemporaryFolder folder;
  const TriangleMesh mesh = worlds::make_asteroid(3, 4, 5);
  tools::write_mesh(folder / "rock.ply", mesh);
  const TriangleMesh back = tools::read_mesh(folder / "rock.ply");
  REQUIRE(back.indices.size() == mesh.indices.size());
  for (std::size_t i = 0; i < mesh.indices.size(); ++i) {
    CHECK(std::memcmp(&mesh.vertices[mesh.indices[i]], &back.vertices[back.indices[i]], sizeof(Vec3f)) == 0);
  }
}

TEST_CASE("mesh paths of a scene are relative to the scene file, not to the working folder") {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "rocks");
  std::filesystem::copy_file(meshes + "/tetrahedron.obj", folder / "rocks/t.obj");
  worlds::write_text(folder / "scene.json", scene_of("rocks/t.obj"));
  worlds::write_text(folder / "motion.csv", motion);
  const ProgramResult result =
      test::ringfence("replay --check --nodes 1 --scene " + (folder / "scene.json") + " --motion " +
                      (folder / "motion.csv") + " --collisions " + (folder / "c.csv"));
  REQUIRE_MESSAGE(result.code == 0, result.out);
  const std::string contacts = worlds::read_text(folder / "c.csv");
  CHECK(std::count(contacts.begin(), contacts.end(), '\n') == 3);
}

TEST_CASE("a missing or unusable mesh file of a scene ends the program with 2 and names shape and file") {
  const TemporaryFolder folder;
  worlds::write_text(folder / "motion.csv", motion);
  for (const char* file : {"none.stl", "lines.obj", "flat.obj"}) {
    CAPTURE(file);
    worlds::write_text(folder / "lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n");
    worlds::write_text(folder / "flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    worlds::write_text(folder / "scene.json", scene_of(file));
    const ProgramResult result =
        test::ringfence("replay --scene " + (folder / "scene.json") + " --motion " + (folder / "motion.csv"));
    CHECK(result.code == 2);
    CHECK_MESSAGE(result.out.find("rock") != std::string::npos, result.out);
    if (std::string(file) != "flat.obj") CHECK_MESSAGE(result.out.find(file) != std::string::npos, result.out);
    if (std::string(file) == "flat.obj") CHECK_MESSAGE(result.out.find("zero area") != std::string::npos, result.out);
  }
}

TEST_CASE("a world of meshes agrees with brute force, and its recording replays with the same digest") {
  const TemporaryFolder folder;
  const std::string prefix = folder / "run";
  const ProgramResult run =
      test::ringfence("record --shapes mesh --objects 300 --users 20 --frames 8 --warmup 2 --nodes 2 " +
                      std::string("--check --out ") + prefix);
  REQUIRE_MESSAGE(run.code == 0, run.out);
  const std::string digest = test::digest_in(run.out);
  REQUIRE(digest.size() == 16);
  for (const char* how : {"--nodes 0", "--nodes 3 --broad-phase region --deployment user"}) {
    const ProgramResult replay =
        test::ringfence("replay --scene " + prefix + ".json --motion " + prefix + ".bin " + std::string(how));
    REQUIRE_MESSAGE(replay.code == 0, replay.out);
    CHECK(test::digest_in(replay.out) == digest);
  }
}

}  // namespace ringfence
