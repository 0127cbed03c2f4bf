#include "recording.hpp"

#include <limits>

#include "exit_code.hpp"
#include "worlds/scene_file.hpp"

namespace ringfence::tools {
namespace {

constexpr double nowhere = std::numeric_limits<double>::quiet_NaN();

}  // namespace

Recording::Recording(const std::string& prefix, const worlds::Scene& scene, const World& world) {
  if (prefix.empty()) return;
  worlds::Scene start = scene;
  for (ObjectSpec& object : start.objects) {
    objects_.push_back(world.find(object.number));
    const ObjectView view = world.object(objects_.back());
    if (!view.id) continue;  // before the first frame an object stands as it was loaded
    object.present = view.spec.present;
    object.pose = view.spec.pose;
  }
  worlds::write_scene(prefix + ".json", start);
  motion_ = std::make_unique<worlds::BinaryMotionWriter>(prefix + ".bin", static_cast<std::uint32_t>(objects_.size()));
}

void Recording::add_frame(const World& world) {
  if (!motion_) return;
  poses_.clear();
  for (const ObjectId object : objects_) {
    const ObjectView view = world.object(object);
    poses_.push_back(view.spec.present ? view.spec.pose : Pose{{nowhere, nowhere, nowhere}, {}});
  }
  try {
    motion_->add_frame(poses_);
  } catch (const Error& error) {
    throw IncompleteError(error.what());
  }
}

void Recording::finish() {
  if (!motion_) return;
  try {
    motion_->finish();
  } catch (const Error& error) {
    throw IncompleteError(error.what());
  }
}

}  // namespace ringfence::tools
