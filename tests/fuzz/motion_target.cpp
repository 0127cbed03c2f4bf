// Property: any bytes as a motion file of a small scene are either refused with a message that begins with the file
// name, or give rows sorted by frame, of movable objects of the scene, with finite poses. Written as CSV, they read
// back as the same rows.
#include <cmath>
#include <string>
#include <string_view>

#include "fuzz/target.hpp"
#include "worlds/motion_file.hpp"
#include "worlds/scene_file.hpp"

using namespace ringfence;

namespace {

constexpr const char* name = "fuzz.csv";

const worlds::Scene& scene() {
  static const worlds::Scene three = worlds::parse_scene(R"({"format": "ringfence-scene", "version": 1,
    "bounds": {"min": [0, 0, 0], "max": [10, 10, 10]},
    "shapes": {"ball": {"type": "sphere", "radius": 1}},
    "objects": [{"id": 1, "shape": "ball", "category": "active", "position": [1, 1, 1]},
                {"id": 2, "shape": "ball", "category": "active"},
                {"id": 7, "shape": "ball", "category": "static", "position": [2, 2, 2]}]})",
                                                         "scene.json");
  return three;
}

void check(const worlds::Motion& motion) {
  std::uint32_t frame = 0;
  for (const worlds::MotionRow& row : motion.rows) {
    fuzz::require(row.frame >= frame && row.frame < motion.frames);
    frame = row.frame;
    fuzz::require(row.object == 1 || row.object == 2);
    const Vec3d& p = row.pose.position;
    fuzz::require(!row.present || (std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(input), size);
  try {
    const worlds::Motion motion = worlds::parse_motion(bytes, name, scene());
    check(motion);
    const std::string text = worlds::format_motion_csv(motion);
    if (!motion.rows.empty() && motion.rows.back().frame + 1 == motion.frames) {
      const worlds::Motion again = worlds::parse_motion(text, name, scene());
      fuzz::require(again.rows == motion.rows && again.frames == motion.frames);
    }
  } catch (const worlds::InputError& error) {
    fuzz::require(std::string_view(error.what()).starts_with(name));
  }
  return 0;
}
