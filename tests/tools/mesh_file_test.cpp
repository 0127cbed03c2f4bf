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

using test::Answer;
using test::Folder;

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

std::string refusal(const std::string& file) {
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
    const std::string what = refusal(file);
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

TEST_CASE("a written mesh reads back bit for bit") {
  const Folder folder;
  const TriangleMesh mesh = worlds::make_asteroid(3, 4, 5);
  tools::write_mesh(folder / "rock.ply", mesh);
  const TriangleMesh back = tools::read_mesh(folder / "rock.ply");
  REQUIRE(back.indices.size() == mesh.indices.size());
  for (std::size_t i = 0; i < mesh.indices.size(); ++i) {
    CHECK(std::memcmp(&mesh.vertices[mesh.indices[i]], &back.vertices[back.indices[i]], sizeof(Vec3f)) == 0);
  }
}

TEST_CASE("a scene's mesh files are found beside it, whatever the working folder") {
  const Folder folder;
  std::filesystem::create_directory(folder / "rocks");
  std::filesystem::copy_file(meshes + "/tetrahedron.obj", folder / "rocks/t.obj");
  worlds::write_text(folder / "scene.json", scene_of("rocks/t.obj"));
  worlds::write_text(folder / "motion.csv", motion);
  const Answer answer = test::ringfence("replay --check --nodes 1 --scene " + (folder / "scene.json") + " --motion " +
                                        (folder / "motion.csv") + " --collisions " + (folder / "c.csv"));
  REQUIRE_MESSAGE(answer.code == 0, answer.out);
  const std::string contacts = worlds::read_text(folder / "c.csv");
  CHECK(std::count(contacts.begin(), contacts.end(), '\n') == 3);
}

TEST_CASE("a scene whose mesh file is missing or empty of triangles ends with 2, the field and the file") {
  const Folder folder;
  worlds::write_text(folder / "motion.csv", motion);
  for (const char* file : {"none.stl", "lines.obj", "flat.obj"}) {
    CAPTURE(file);
    worlds::write_text(folder / "lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n");
    worlds::write_text(folder / "flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    worlds::write_text(folder / "scene.json", scene_of(file));
    const Answer answer =
        test::ringfence("replay --scene " + (folder / "scene.json") + " --motion " + (folder / "motion.csv"));
    CHECK(answer.code == 2);
    CHECK_MESSAGE(answer.out.find("rock") != std::string::npos, answer.out);
    if (std::string(file) != "flat.obj") CHECK_MESSAGE(answer.out.find(file) != std::string::npos, answer.out);
    if (std::string(file) == "flat.obj") CHECK_MESSAGE(answer.out.find("zero area") != std::string::npos, answer.out);
  }
}

TEST_CASE("a world of meshes agrees with brute force and replays from its recording with the same digest") {
  const Folder folder;
  const std::string prefix = folder / "run";
  const Answer run = test::ringfence("record --shapes mesh --objects 300 --users 20 --frames 8 --warmup 2 --nodes 2 " +
                                     std::string("--check --out ") + prefix);
  REQUIRE_MESSAGE(run.code == 0, run.out);
  const std::string digest = test::digest_in(run.out);
  REQUIRE(digest.size() == 16);
  for (const char* how : {"--nodes 0", "--nodes 3 --broad-phase region --deployment user"}) {
    const Answer replay =
        test::ringfence("replay --scene " + prefix + ".json --motion " + prefix + ".bin " + std::string(how));
    REQUIRE_MESSAGE(replay.code == 0, replay.out);
    CHECK(test::digest_in(replay.out) == digest);
  }
}

}  // namespace ringfence
