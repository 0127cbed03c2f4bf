#include "gateway/clients/spectator_view.hpp"

namespace ringfence::gateway {

void SpectatorView::describe(Client& client, std::span<const ObjectView> objects, Stamp now, Update& update) {
  near_.clear();
  const View view = client.view.value_or(View{});
  for (const ObjectView& object : objects) {
    if (!object.spec.enabled) continue;
    const Vec3d& p = object.spec.pose.position;
    const double x = p.x - view.centre.x, y = p.y - view.centre.y, z = p.z - view.centre.z;
    if (client.view && x * x + y * y + z * z > view.radius * view.radius) continue;
    const std::uint32_t index = table_.refresh(object.id.number(), object.spec.pose);
    if (index != ObjectTable::none) near_.push_back(index);
  }
  // Objects are in order of number.
  if (client.view) update.origin = quantise(view.centre);
  client.known.add_changes(near_, table_, now, client.acknowledged, update);
}

}  // namespace ringfence::gateway
