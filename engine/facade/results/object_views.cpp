#include "facade/results/object_views.hpp"

#include <algorithm>

#include "base/number_index.hpp"

namespace ringfence::facade {

std::uint32_t slot_of(const nodes::ServerRole& server, ObjectId object) noexcept {
  const nodes::ObjectTable& table = server.objects();
  const std::uint32_t slot = table.find(object.number());
  const bool there = slot != base::NumberIndex::none && table.row(slot).object.generation == object.generation();
  return there ? slot : base::NumberIndex::none;
}

ObjectView view_of(const nodes::ServerRole& server, std::uint32_t slot) {
  const nodes::ObjectTable& objects = server.objects();
  const nodes::ObjectRow& row = objects.row(slot);
  const nodes::ObjectOrigin& origin = objects.origin(slot);
  ObjectView view;
  view.id = ObjectId::of(row.object.number, row.object.generation);
  view.spec = {row.object.number,
               ShapeId(row.shape),
               static_cast<Category>(row.category),
               static_cast<std::uint8_t>(row.layer),
               objects.group(slot),
               (row.object.flags & messages::flag_present) != 0,
               UserId(origin.user),
               origin.user_data,
               server.pose(slot)};
  return view;
}

std::vector<ObjectView> views_of(const nodes::ServerRole& server) {
  const nodes::ObjectTable& table = server.objects();
  std::vector<ObjectView> views;
  views.reserve(table.live());
  for (std::uint32_t slot = 0; slot < table.slots(); ++slot) {
    if (table.alive(slot)) {
      views.push_back(view_of(server, slot));
    }
  }
  std::sort(views.begin(), views.end(),
            [](const ObjectView& p, const ObjectView& q) { return p.spec.number < q.spec.number; });
  return views;
}

}  // namespace ringfence::facade
