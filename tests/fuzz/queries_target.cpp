// Property: any bytes as a query file of a small scene are either refused with a message that begins with the file name
// and a line, or give queries that are sorted by frame and id, each once, about shapes, layers and objects of the
// scene.
#include <cmath>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "fuzz/target.hpp"
#include "worlds/query_file.hpp"
#include "worlds/scene_file.hpp"

using namespace ringfence;

namespace {

constexpr std::string_view name = "fuzz.csv:";
constexpr std::uint32_t frames = 100;

const worlds::Scene& scene() {
  static const worlds::Scene two = worlds::parse_scene(R"({"format": "ringfence-scene", "version": 1,
    "bounds": {"min": [0, 0, 0], "max": [10, 10, 10]},
    "layers": {"names": ["a", "b"], "collide": [["a", "b"]]},
    "shapes": {"ball": {"type": "sphere", "radius": 1}},
    "objects": [{"id": 1, "shape": "ball", "category": "active", "layer": "a", "position": [1, 1, 1]},
                {"id": 2, "shape": "ball", "category": "active", "layer": "b"}]})",
                                                       "scene.json");
  return two;
}

bool is_valid(const Vec3d& p) {
  return std::abs(p.x) <= farthest_coordinate && std::abs(p.y) <= farthest_coordinate &&
         std::abs(p.z) <= farthest_coordinate;
}

void check(const std::vector<worlds::QueryRow>& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const worlds::QueryRow& row = rows[i];
    fuzz::require(i == 0 || std::tie(rows[i - 1].frame, rows[i - 1].query) < std::tie(row.frame, row.query));
    fuzz::require(row.frame < frames && row.shape == 0 && row.except <= 2 && row.distance >= 0);
    fuzz::require(row.layers == 0xffffffffu || (row.layers >= 1 && row.layers <= 3));
    fuzz::require(is_valid(row.pose.position) && is_valid(row.displacement) && std::isfinite(row.distance));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(input), size);
  try {
    check(worlds::parse_queries(bytes, "fuzz.csv", scene(), frames));
  } catch (const worlds::InputError& error) {
    fuzz::require(std::string_view(error.what()).starts_with(name));
  }
  return 0;
}
