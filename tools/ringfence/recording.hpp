#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ringfence/world.hpp"
#include "worlds/motion_file.hpp"
#include "worlds/scene.hpp"

namespace ringfence::tools {

/// Writes a run as PREFIX.json and PREFIX.bin: the scene as it stands before the first counted frame, and where every
/// object is in each. Meshes go to the folder PREFIX-meshes.
class Recording {
 public:
  /// With an empty prefix nothing is recorded. `scene` is what was loaded into `world`; its objects are looked up by
  /// number.
  Recording(const std::string& prefix, const worlds::Scene& scene, const World& world);

  /// After a counted frame. Throws IncompleteError when it cannot be written.
  void add_frame(const World& world);
  void finish();

 private:
  std::unique_ptr<worlds::BinaryMotionWriter> motion_;
  std::vector<ObjectId> objects_;  ///< in the scene's order
  std::vector<Pose> poses_;
};

}  // namespace ringfence::tools
