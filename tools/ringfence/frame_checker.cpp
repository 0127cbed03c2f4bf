#include "frame_checker.hpp"

#include <fmt/format.h>

namespace ringfence::tools {
namespace {

constexpr std::uint64_t max_printed = 50;

}  // namespace

FrameChecker::FrameChecker(const World& world, bool brute_force) : world_(world), brute_force_(brute_force) {
  if (!brute_force_) return;
  const LayerMatrix& layers = world.config().layers;
  for (std::size_t layer = 0; layer < layers.names.size(); ++layer) {
    layer_masks_.push_back(layers.mask(static_cast<std::uint8_t>(layer)));
  }
}

void FrameChecker::check_counters() {
  const FrameReport& report = world_.report();
  if (report.candidates == report.tested && report.tested == report.accepted) return;
  if (miscounted_++ < max_printed) {
    fmt::print(stderr, "ringfence: frame {}: {} candidates, {} tested, {} accepted; expected each exactly once\n",
               report.frame, report.candidates, report.tested, report.accepted);
  }
}

void FrameChecker::skip_frame() {
  check_counters();
  if (brute_force_) before_.assign(world_.contacts().begin(), world_.contacts().end());
}

void FrameChecker::print_differences(const std::vector<reference::Difference>& differences) {
  for (const reference::Difference& difference : differences) {
    if (differences_++ < max_printed) fmt::print(stderr, "ringfence: {}\n", difference.text);
  }
}

void FrameChecker::check_frame(std::uint64_t frame) {
  check_counters();
  if (!brute_force_) return;
  for (std::size_t shape = shapes_.size(); shape < world_.shape_count(); ++shape) {
    const ShapeId id(static_cast<std::uint32_t>(shape));
    shapes_.add(world_.has_shape(id) ? world_.shape(id) : ShapeDescription(Sphere{1}));  // no object has a removed one
  }
  std::vector<reference::FrameObject> objects;
  for (const ObjectView& view : world_.objects()) {
    const ObjectSpec& spec = view.spec;
    objects.push_back({spec.number, spec.shape.number(), spec.layer, spec.enabled, spec.pose,
                       spec.category == Category::fixed, spec.group, view.id.generation(), spec.user_data});
  }
  print_differences(reference::check_frame(frame, shapes_, objects, layer_masks_, world_.contacts()));
  print_differences(reference::check_phases(frame, before_, world_.contacts(), world_.ended()));
  before_.assign(world_.contacts().begin(), world_.contacts().end());
  ++frames_;
}

}  // namespace ringfence::tools
