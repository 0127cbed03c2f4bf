#include "trace.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace ringfence::tools {
namespace {

constexpr std::uint32_t copy_delay = 7,
                        max_copy_delay = 101;  // frames between copies; delays wrap around at the maximum

struct Extents {
  Vec3d low{std::numeric_limits<double>::max(), std::numeric_limits<double>::max(), std::numeric_limits<double>::max()};
  Vec3d high{std::numeric_limits<double>::lowest(), std::numeric_limits<double>::lowest(),
             std::numeric_limits<double>::lowest()};
};

Extents extents_of(const Trace& trace) {
  Extents extents;
  for (const auto& [name, samples] : trace.tracks) {
    for (const Sample& sample : samples) {
      const Vec3d& p = sample.position;
      extents.low = {std::min(extents.low.x, p.x), std::min(extents.low.y, p.y), std::min(extents.low.z, p.z)};
      extents.high = {std::max(extents.high.x, p.x), std::max(extents.high.y, p.y), std::max(extents.high.z, p.z)};
    }
  }
  return extents;
}

/// Rounds to a multiple of `step`, as the double nearest to its decimal text, so that files stay short.
double rounded(double value, double step) {
  const double per_metre = std::round(1 / step);
  return std::round(value * per_metre) / per_metre;
}

/// Adds the rows of one track, shifted by `late` frames and in metres by `east` and `north`: its samples, interpolated
/// frames between them, and absence in long gaps and after the last sample.
void add_rows(const Trace& trace, const std::vector<Sample>& samples, ObjectNumber object, std::uint32_t late,
              double east, double north, std::vector<worlds::MotionRow>& rows) {
  const auto add = [&](std::uint32_t frame, const Vec3d& p) {
    rows.push_back(
        {frame + late,
         object,
         true,
         false,
         {{rounded(p.x + east, trace.step), rounded(p.y + north, trace.step), rounded(p.z, trace.step)}, {}}});
  };
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& current = samples[i];
    add(current.frame, current.position);
    if (i + 1 == samples.size()) break;
    const Sample& next = samples[i + 1];
    if (next.frame - current.frame > trace.longest_gap) {
      rows.push_back({current.frame + 1 + late, object, false, false, {}});
      continue;
    }
    for (std::uint32_t frame = current.frame + 1; frame < next.frame; ++frame) {
      const double share = static_cast<double>(frame - current.frame) / (next.frame - current.frame);
      const Vec3d &p = current.position, &q = next.position;
      add(frame, {p.x + share * (q.x - p.x), p.y + share * (q.y - p.y), p.z + share * (q.z - p.z)});
    }
  }
  rows.push_back({samples.back().frame + 1 + late, object, false, false, {}});
}

}  // namespace

TraceWorld make_trace_world(const Trace& trace, std::uint32_t copies) {
  const Extents extents = extents_of(trace);
  const double margin = trace.margin;
  const double width = std::ceil(extents.high.x - extents.low.x + 2 * margin);
  const double depth = std::ceil(extents.high.y - extents.low.y + 2 * margin);
  std::uint32_t columns = 1;
  while (std::uint64_t{columns} * columns < copies) ++columns;
  const std::uint32_t rows_of_copies = (copies + columns - 1) / columns;

  TraceWorld world;
  world.scene.shapes.push_back(trace.shape);
  world.scene.contact_label = trace.contact_label;
  world.scene.bounds_min = {std::floor(extents.low.x - margin), std::floor(extents.low.y - margin),
                            std::floor(extents.low.z - margin)};
  world.scene.bounds_max = {world.scene.bounds_min.x + columns * width + 1,
                            world.scene.bounds_min.y + rows_of_copies * depth + 1, std::ceil(extents.high.z + margin)};

  std::uint32_t last = 0;
  for (const auto& [name, samples] : trace.tracks) last = std::max(last, samples.back().frame);
  ObjectNumber number = 0;
  for (std::uint32_t copy = 0; copy < copies; ++copy) {
    const std::uint32_t column = copy % columns, row = copy / columns;
    for (const auto& [name, samples] : trace.tracks) {
      ObjectSpec object;
      object.number = ++number;
      object.category = Category::active;
      object.enabled = false;
      world.scene.objects.push_back(object);
      const std::uint32_t late = copy * copy_delay % max_copy_delay;
      add_rows(trace, samples, number, late, column * width, row * depth, world.motion.rows);
    }
  }
  auto& rows = world.motion.rows;
  std::sort(rows.begin(), rows.end(), [](const worlds::MotionRow& p, const worlds::MotionRow& q) {
    return std::tie(p.frame, p.object) < std::tie(q.frame, q.object);
  });
  // Rows after the last frame with a sample would only make objects absent.
  const std::uint32_t end = last + std::min((copies - 1) * copy_delay, max_copy_delay - 1) + 1;
  std::erase_if(rows, [end](const worlds::MotionRow& row) { return row.frame >= end; });
  world.motion.frames = rows.empty() ? 0 : rows.back().frame + 1;
  return world;
}

}  // namespace ringfence::tools
