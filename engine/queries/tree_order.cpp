#include "queries/tree_order.hpp"

#include <algorithm>

#include "queries/tree_kernels.hpp"

namespace ringfence::queries {

void CurveSort::sort(std::span<const FrameObject> objects, const geometry::FixedSpace& space,
                     std::vector<std::uint32_t>& rows) {
  const TreeKernels kernels = choose_tree_kernels();
  alignas(64) std::uint32_t cells[3][curve_block] = {};
  alignas(64) std::uint32_t places[curve_block];
  sort_.clear();
  for (std::size_t first = 0; first < rows.size(); first += curve_block) {
    const std::size_t count = std::min(curve_block, rows.size() - first);
    for (std::size_t i = 0; i < count; ++i) {
      std::uint32_t point[3];
      space.point(objects[rows[first + i]].pose.position, point);
      for (std::size_t a = 0; a < 3; ++a) cells[a][i] = point[a] >> (32 - curve_bits);
    }
    kernels.curve_places(cells, places);
    for (std::size_t i = 0; i < count; ++i) sort_.add(places[i]);
  }
  sort_.sort();
  sorted_.resize(rows.size());
  for (std::size_t i = 0; i < sorted_.size(); ++i) sorted_[i] = rows[sort_.at(i)];
  rows.swap(sorted_);
}

std::shared_ptr<const TreeOrder> adapt(std::shared_ptr<const TreeOrder> before, std::span<const FrameObject> objects,
                                       std::size_t count) {
  if (before == nullptr) return nullptr;
  const auto has_object = [&](std::uint32_t row) { return row < objects.size() && objects[row].number != 0; };
  const auto kept = static_cast<std::size_t>(std::count_if(before->rows.begin(), before->rows.end(), has_object));
  if (kept == count && kept == before->rows.size()) return before;
  constexpr std::size_t most_new = 64;  // of so many, one
  if ((count - kept) * most_new > count) return nullptr;
  auto adapted = std::make_shared<TreeOrder>();
  adapted->cost = before->cost;
  adapted->rows.reserve(count);
  std::vector<bool> listed(objects.size());
  for (const std::uint32_t row : before->rows) {
    if (!has_object(row)) continue;
    adapted->rows.push_back(row);
    listed[row] = true;
  }
  for (std::uint32_t row = 0; row < objects.size(); ++row) {
    if (objects[row].number != 0 && !listed[row]) adapted->rows.push_back(row);
  }
  return adapted;
}

}  // namespace ringfence::queries
