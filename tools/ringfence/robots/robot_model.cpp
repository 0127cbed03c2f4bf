#include "robots/robot_model.hpp"

#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

/// As `ringfence serve` sets the user data of the objects of its scene.
std::uint64_t user_data_of(const gateway::Replica::Object& object) {
  return object.category == Category::non_active ? motion::gives_way : 0;
}

}  // namespace

RobotModel::RobotModel() : obstacles_(user_data_of) {}

void RobotModel::begin(const gateway::Welcome& welcome) {
  if (walk_) return;
  std::optional<motion::WalkConfig> config = motion::Walk::read_parameters(welcome.parameters);
  if (welcome.model != "walk" || !config) {
    throw Error("--predict: the model of this world is " + std::string(welcome.model) + "; robots predict walk only");
  }
  config->bounds_min = welcome.bounds_min;
  config->bounds_max = welcome.bounds_max;
  walk_.emplace(*config);
}

}  // namespace ringfence::tools
