#include "queries/tree_order.hpp"

namespace ringfence::queries {

bool adapt(const TreeOrder& before, const FrameRows& objects, TreeOrder& out) {
  thread_local std::vector<bool> listed;
  listed.assign(objects.row_of.size(), false);
  out.cost = before.cost;
  out.keys.clear();
  for (const std::uint32_t key : before.keys) {
    if (objects.row(key) == FrameRows::none) continue;
    out.keys.push_back(key);
    listed[key] = true;
  }
  constexpr std::size_t most_new = 64;  // of so many, one
  if ((objects.objects - out.keys.size()) * most_new > objects.objects) return false;
  for (std::uint32_t key = 0; key < objects.row_of.size(); ++key) {
    if (objects.row_of[key] != FrameRows::none && !listed[key]) out.keys.push_back(key);
  }
  return true;
}

}  // namespace ringfence::queries
