#include "geometry/mesh.hpp"

#include <string>

#include <doctest/doctest.h>

#include "ringfence/error.hpp"

using namespace ringfence;

namespace {

std::string refusal(const TriangleMesh& mesh) {
  try {
    geometry::Mesh{mesh};
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

const std::vector<Vec3f> corners{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {4, 0, 0}};

}  // namespace

TEST_CASE("triangles of zero area are dropped and counted, and the others keep their order") {
  const geometry::Mesh mesh({corners, {0, 1, 2, 0, 1, 4, 1, 1, 2, 0, 2, 3}});
  CHECK(mesh.dropped_triangles() == 2);
  REQUIRE(mesh.triangles().size() == 2);
  CHECK(mesh.triangles()[1] == std::array<std::uint32_t, 3>{0, 2, 3});
  CHECK(mesh.bounding_radius() >= 2.0f);
  CHECK(mesh.bounding_radius() < 2.0001f);
  CHECK(mesh.box_centre() == Vec3f{1, 1, 1});
  CHECK(mesh.box_half_extents().x >= 1.0f);
  CHECK(mesh.box_half_extents().x < 1.0001f);
}

TEST_CASE("an invalid mesh is refused with the reason") {
  CHECK(refusal({corners, {0, 1}}).find("multiple of 3") != std::string::npos);
  CHECK(refusal({corners, {}}).find("no triangles") != std::string::npos);
  CHECK(refusal({corners, {0, 1, 2, 0, 1, 5}}).find("index 5 of triangle 1") != std::string::npos);
  CHECK(refusal({corners, {0, 1, 4}}).find("zero area") != std::string::npos);
  CHECK(refusal({{{0, 0, 0}, {1.0f / 0.0f, 0, 0}, {0, 1, 0}}, {0, 1, 2}}).find("vertex 1") != std::string::npos);
}
