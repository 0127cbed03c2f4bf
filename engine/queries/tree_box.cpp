#include "queries/tree_box.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "geometry/outer_steps.hpp"
#include "geometry/vector.hpp"

namespace ringfence::queries {
namespace {

constexpr std::uint32_t last_step = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t most_samples = 64;

/// The positions of some objects along each axis, ascending.
struct Sample {
  std::size_t size = 0;
  std::array<std::array<double, most_samples>, 3> at;

  Sample(std::span<const FrameObject> rows, std::span<const std::uint32_t> objects)
      : size(std::min(most_samples, objects.size())), at{} {
    for (std::size_t i = 0; i < size; ++i) {
      const Vec3d& position = rows[objects[i * objects.size() / size]].pose.position;
      at[0][i] = position.x, at[1][i] = position.y, at[2][i] = position.z;
    }
    for (auto& axis : at) std::sort(axis.begin(), axis.begin() + static_cast<std::ptrdiff_t>(size));
  }
};

}  // namespace

BoxConverter::BoxConverter(const geometry::FixedSpace& space, const Vec3d& origin) noexcept : origin_(origin) {
  const geometry::FixedSpace::Rows& rows = space.rows();
  const double from[3] = {origin.x, origin.y, origin.z};
  const bool has_octaves = std::isfinite(rows.first[0]);
  // Without octaves, only the outermost steps are not of equal size: bounds saturate there.
  first_ = has_octaves ? static_cast<std::uint32_t>(rows.first[0]) : 1;
  last_ = has_octaves ? static_cast<std::uint32_t>(rows.last[0]) : last_step - 1;
  for (std::size_t a = 0; a < 3; ++a) {
    metres_[a] = 1 / rows.scale[a];
    offset_[a] = rows.min[a] - from[a];
    const double side = geometry::all_steps * metres_[a];
    const double error = 0x1p-50 * (std::abs(rows.min[a]) + std::abs(from[a]) + side);
    slack_[a] = static_cast<float>((metres_[a] + error) * (1 + 0x1p-20));
  }
}

TreeBox BoxConverter::operator()(const RowBounds& row) const noexcept {
  TreeBox out;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto low = static_cast<float>(place(a, row.bounds.lower[a], false));
    const auto high = static_cast<float>(place(a, row.bounds.upper[a], true));
    const float more = (row.margin + slack_[a]) * (1 + rounding);
    out.lower[a] = low - (more + rounding * std::abs(low));
    out.upper[a] = high + (more + rounding * std::abs(high));
  }
  return out;
}

/// The end of a step that is farther up or down. In the octaves, the inverse of FixedSpace::Rows::outer_step(), which
/// rounds towards the inner steps.
double BoxConverter::place(std::size_t axis, std::uint32_t step, bool up) const noexcept {
  if (step == 0) return up ? offset_[axis] + static_cast<double>(first_) * metres_[axis] : -infinity;
  if (step == last_step) return up ? infinity : offset_[axis] + static_cast<double>(last_) * metres_[axis];
  if (step >= first_ && step <= last_) return offset_[axis] + static_cast<double>(step) * metres_[axis];
  const bool below = step < first_;
  const std::int64_t beyond = std::int64_t{below ? first_ - step : step - last_} + (below == up ? 0 : 1);
  const std::uint64_t bits = static_cast<std::uint64_t>(beyond + (std::int64_t{1023} << geometry::octave_log2))
                             << (52 - geometry::octave_log2);
  const double steps =
      (std::bit_cast<double>(bits) - 1) * geometry::inner_steps * (1 + (below == up ? -1 : 1) * 0x1p-50);
  return offset_[axis] +
         (below ? static_cast<double>(first_) - steps : static_cast<double>(last_) + steps) * metres_[axis];
}

Vec3d choose_origin(std::span<const FrameObject> rows, std::span<const std::uint32_t> objects) {
  if (objects.empty()) return {};
  const Sample sample(rows, objects);
  const std::size_t middle = sample.size / 2;
  return {sample.at[0][middle], sample.at[1][middle], sample.at[2][middle]};
}

geometry::FixedSpace space_around(const Vec3d& origin, std::span<const FrameObject> rows,
                                  std::span<const std::uint32_t> objects) {
  const Sample sample(rows, objects);
  double side = 1024;
  for (const auto& axis : sample.at) {
    // Without the outermost objects, which may be very far from the others.
    const std::size_t left_out = sample.size / 16;
    if (sample.size != 0) side = std::max(side, 4 * (axis[sample.size - 1 - left_out] - axis[left_out]));
  }
  const Vec3d half{side, side, side};
  return {origin - half, origin + half, geometry::Outside::has_octaves};
}

}  // namespace ringfence::queries
