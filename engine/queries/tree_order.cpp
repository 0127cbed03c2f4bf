#include "queries/tree_order.hpp"

#include <algorithm>

namespace ringfence::queries {

bool has_same_rows(const TreeOrder& order, std::span<const FrameObject> objects, std::size_t count) noexcept {
  return order.rows.size() == count && order.end <= objects.size() &&
         std::all_of(order.rows.begin(), order.rows.end(), [&](std::uint32_t row) { return objects[row].number != 0; });
}

bool adapt(const TreeOrder& before, std::span<const FrameObject> objects, std::size_t count, TreeOrder& out) {
  thread_local std::vector<bool> listed;
  listed.assign(objects.size(), false);
  out.cost = before.cost;
  out.end = static_cast<std::uint32_t>(objects.size());
  out.rows.clear();
  for (const std::uint32_t row : before.rows) {
    if (row >= objects.size() || objects[row].number == 0) continue;
    out.rows.push_back(row);
    listed[row] = true;
  }
  constexpr std::size_t most_new = 64;  // of so many, one
  if ((count - out.rows.size()) * most_new > count) return false;
  for (std::uint32_t row = 0; row < objects.size(); ++row) {
    if (objects[row].number != 0 && !listed[row]) out.rows.push_back(row);
  }
  return true;
}

}  // namespace ringfence::queries
