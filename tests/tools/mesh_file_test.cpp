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

/// The corners of the triangles, each triangle beginning with its least corner, all in order.
std::vector<std::array<float, 9>> triangles_of(const TriangleMesh& mesh, float raised) {
  std::vector<std::array<float, 9>> out;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    std::array<std::array<float, 3>, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f v = mesh.vertices[mesh.indices[i + k]];
      corners[k] = {v.x, v.y, v.z - raised};
    }
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    std::array<float, 9> flat;
    for (std::size_t k = 0; k < 9; ++k) flat[k] = corners[k / 3][k % 3];
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

/// Two objects of a mesh a step apart, and a motion that brings them together.
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
  for (const char* ending : {"obj", "stl", "ply", "gltf", "3ds"}) {
    CAPTURE(ending);
    const TriangleMesh mesh = tools::read_mesh(meshes + "/tetrahedron." + ending);
    // The node of the glTF file stands two metres up.
    const float raised = std::string(ending) == "gltf" ? 2.0f : 0.0f;
    CHECK(triangles_of(mesh, raised) == triangles_of(expected, 0));
    CHECK(mesh.vertices.size() == 4);
  }
}

TEST_CASE("a mesh file that cannot be read is named with the reason") {
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

TEST_CASE("a mesh file that is not finite, too large or promises more than it holds is refused") {
  const auto refused = [](const std::string& name, const std::string& text, const std::string& why) {
    try {
      tools::parse_mesh(text, name);
      FAIL_CHECK(name << " is taken");
    } catch (const Error& error) {
      const std::string what = error.what();
      CHECK_MESSAGE(what.starts_with(name + ": "), what);
      CHECK_MESSAGE(what.find(why) != std::string::npos, what);
    }
  };
  refused("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "is no place");
  refused("inf.obj", "v 0 0 0\nv 1e39 0 0\nv 0 1 0\nf 1 2 3\n", "is no place");
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  refused("promise.ply", header, "4000000000 elements");
  refused("endless.ply", header.substr(0, header.size() - 12) + " end_header\n", "has no PLY header");
  refused("uncounted.ply", "ply\nformat ascii 1.0\nelement vertex\nend_header\n", "without a number");
  std::string many = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < 1'000'001; ++i) many += "f 1 2 3\n";
  refused("many.obj", many, "has 1000001 triangles");
}

TEST_CASE("a mesh file that makes its reader crash is refused, and the program lives") {
  // A node that is its own child: assimp follows it until the stack ends.
  const std::string circle = R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
    "nodes": [{"children": [1]}, {"children": [0]}]})";
  try {
    tools::parse_mesh(circle, "circle.gltf");
    FAIL_CHECK("a circle is taken");
  } catch (const Error& error) {
    CHECK(std::string(error.what()).starts_with("circle.gltf: "));
  }
}

TEST_CASE("a glTF file reads its buffers beside it and below, and nothing elsewhere") {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "scene/parts");
  std::string corners;
  for (const float x : {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f}) {
    corners.append(reinterpret_cast<const char*>(&x), sizeof x);
  }
  worlds::write_text(folder / "scene/parts/corners.bin", corners);
  worlds::write_text(folder / "corners.bin", corners);
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
  CHECK(triangles("parts/corners.bin") == 1);
  CHECK(triangles("../corners.bin") == 0);
  CHECK(triangles("parts/../../corners.bin") == 0);
  CHECK(triangles(folder / "corners.bin") == 0);
  CHECK(triangles("none.bin") == 0);
}

TEST_CASE("a written mesh reads back bit for bit") {
  const TemporaryFolder folder;
  const TriangleMesh mesh = worlds::make_asteroid(3, 4, 5);
  tools::write_mesh(folder / "rock.ply", mesh);
  const TriangleMesh back = tools::read_mesh(folder / "rock.ply");
  REQUIRE(back.indices.size() == mesh.indices.size());
  for (std::size_t i = 0; i < mesh.indices.size(); ++i) {
    CHECK(std::memcmp(&mesh.vertices[mesh.indices[i]], &back.vertices[back.indices[i]], sizeof(Vec3f)) == 0);
  }
}

TEST_CASE("a scene's mesh files are found beside it, whatever the working folder") {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "rocks");
  std::filesystem::copy_file(meshes + "/tetrahedron.obj", folder / "rocks/t.obj");
  worlds::write_text(folder / "scene.json", scene_of("rocks/t.obj"));
  worlds::write_text(folder / "motion.csv", motion);
  const ProgramResult answer =
      test::ringfence("replay --check --nodes 1 --scene " + (folder / "scene.json") + " --motion " +
                      (folder / "motion.csv") + " --collisions " + (folder / "c.csv"));
  REQUIRE_MESSAGE(answer.code == 0, answer.out);
  const std::string contacts = worlds::read_text(folder / "c.csv");
  CHECK(std::count(contacts.begin(), contacts.end(), '\n') == 3);
}

TEST_CASE("a scene whose mesh file is missing or empty of triangles ends with 2, the field and the file") {
  const TemporaryFolder folder;
  worlds::write_text(folder / "motion.csv", motion);
  for (const char* file : {"none.stl", "lines.obj", "flat.obj"}) {
    CAPTURE(file);
    worlds::write_text(folder / "lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n");
    worlds::write_text(folder / "flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    worlds::write_text(folder / "scene.json", scene_of(file));
    const ProgramResult answer =
        test::ringfence("replay --scene " + (folder / "scene.json") + " --motion " + (folder / "motion.csv"));
    CHECK(answer.code == 2);
    CHECK_MESSAGE(answer.out.find("rock") != std::string::npos, answer.out);
    if (std::string(file) != "flat.obj") CHECK_MESSAGE(answer.out.find(file) != std::string::npos, answer.out);
    if (std::string(file) == "flat.obj") CHECK_MESSAGE(answer.out.find("zero area") != std::string::npos, answer.out);
  }
}

TEST_CASE("a world of meshes agrees with brute force and replays from its recording with the same digest") {
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
