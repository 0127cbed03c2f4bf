#include "recording.hpp"

#include <filesystem>
#include <limits>
#include <system_error>

#include "exit_code.hpp"
#include "mesh_file.hpp"
#include "ringfence/error.hpp"
#include "worlds/scene_file.hpp"

namespace ringfence::tools {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

/// Writes the meshes of a scene to the folder PREFIX-meshes and sets their paths in the scene, so that a recording does
/// not depend on other files.
void write_meshes(const std::string& prefix, worlds::Scene& scene) {
  const std::filesystem::path folder = prefix + "-meshes";
  std::size_t count = 0;
  for (worlds::NamedShape& shape : scene.shapes) {
    const auto* mesh = std::get_if<TriangleMesh>(&shape.description);
    if (mesh == nullptr) continue;
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw Error(folder.string() + ": " + error.message());
    const std::filesystem::path file = std::to_string(count++) + ".ply";
    write_mesh(folder / file, *mesh);
    shape.mesh_file = (folder.filename() / file).string();
  }
}

}  // namespace

Recording::Recording(const std::string& prefix, const worlds::Scene& scene, const World& world) {
  if (prefix.empty()) return;
  worlds::Scene start = scene;
  for (ObjectSpec& object : start.objects) {
    objects_.push_back(world.find(object.number));
    const ObjectView view = world.object(objects_.back());
    if (!view.id) continue;  // before the first frame the loaded pose holds
    object.enabled = view.spec.enabled;
    object.pose = view.spec.pose;
  }
  write_meshes(prefix, start);
  worlds::write_scene(prefix + ".json", start);
  motion_ = std::make_unique<worlds::BinaryMotionWriter>(prefix + ".bin", static_cast<std::uint32_t>(objects_.size()));
}

void Recording::add_frame(const World& world) {
  if (!motion_) return;
  poses_.clear();
  for (const ObjectId object : objects_) {
    const ObjectView view = world.object(object);
    poses_.push_back(view.spec.enabled ? view.spec.pose : Pose{{not_a_number, not_a_number, not_a_number}, {}});
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
