#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ringfence/world.hpp"
#include "worlds/motion_file.hpp"
#include "worlds/scene.hpp"

namespace ringfence::tools {

/// Records a run for replay: PREFIX.json is the scene before the first counted frame, and PREFIX.bin has the poses of
/// all objects in each counted frame. Meshes are written to the folder PREFIX-meshes.
class Recording {
 public:
  /// Writes scene and meshes. With an empty prefix all members do nothing. `scene` is the scene that was loaded into
  /// `world`. Throws Error if a file cannot be written.
  Recording(const std::string& prefix, const worlds::Scene& scene, const World& world);

  /// To be called after each counted frame. Throws IncompleteError if the file cannot be written.
  void add_frame(const World& world);
  void finish();

 private:
  std::unique_ptr<worlds::BinaryMotionWriter> motion_;
  std::vector<ObjectId> objects_;  ///< in the order of the scene
  std::vector<Pose> poses_;
};

}  // namespace ringfence::tools
