#include "facade/recorded_world.hpp"

#include <algorithm>

#include "ringfence/world.hpp"
#include "worlds/load.hpp"

namespace ringfence::bench {

RecordedWorld record_world(worlds::ShapeSetting shapes, std::uint32_t objects, std::size_t frames) {
  constexpr std::size_t settling = 20;
  worlds::PaperWorldOptions options;
  options.objects = objects;
  options.shapes = shapes;
  options.users = 0;
  worlds::PaperWorld paper = worlds::make_paper_world(options);

  WorldConfig config;
  config.nodes = 0;
  config.motion = std::make_shared<motion::Steering>(paper.steering);
  worlds::configure_for(config, paper.scene, 0);
  World world(config);
  worlds::load_into(world, paper.scene, 0);

  RecordedWorld recorded;
  recorded.scene = std::move(paper.scene);
  recorded.space = geometry::FixedSpace(config.bounds_min, config.bounds_max);
  recorded.shapes = std::make_unique<geometry::ShapeTable>();
  for (const worlds::NamedShape& shape : recorded.scene.shapes) recorded.shapes->add(shape.description);
  for (std::size_t frame = 0; frame < settling + frames; ++frame) {
    require_ok(world.advance());
    if (frame < settling) continue;
    std::vector<Pose>& poses = recorded.frames.emplace_back();
    for (const ObjectView& object : world.objects()) poses.push_back(object.spec.pose);
  }
  for (std::size_t i = 0; i < recorded.objects(); ++i) recorded.scene.objects[i].pose = recorded.frames[0][i];
  return recorded;
}

void let_rest(RecordedWorld& world, std::uint32_t percent) {
  for (std::uint32_t i = 0; i < world.objects(); ++i) {
    const std::uint32_t spread = i * 2654435761u >> 16;
    if (spread % 100 >= percent) continue;
    for (std::vector<Pose>& poses : world.frames) poses[i] = world.frames[0][i];
  }
}

void let_all_move(RecordedWorld& world) {
  constexpr double step = 0.02;
  for (std::size_t i = 0; i < world.objects(); ++i) {
    Pose before = world.frames[0][i];
    double moved = 0;
    for (std::size_t frame = 1; frame < world.frames.size(); ++frame) {
      Pose& pose = world.frames[frame][i];
      const Pose recorded = pose;
      moved += recorded == before ? step : 0;
      pose.position.x += moved;
      before = recorded;
    }
  }
}

std::vector<std::uint64_t> ContactList::keys() const {
  std::vector<std::uint64_t> keys;
  for (const Contact& contact : contacts_) {
    keys.push_back(std::uint64_t{std::min(contact.a, contact.b)} << 32 | std::max(contact.a, contact.b));
  }
  return keys;
}

}  // namespace ringfence::bench
