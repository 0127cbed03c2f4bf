#include "gateway/clients/spectator_view.hpp"

namespace ringfence::gateway {
namespace {

/// More pairs than this are not sent, so that an update of a crowded world stays small.
constexpr std::size_t max_touching = 4096;

bool is_in_view(const Client& client, const Vec3d& point) noexcept {
  if (!client.view) return true;
  const Vec3d& centre = client.view->centre;
  const double x = point.x - centre.x, y = point.y - centre.y, z = point.z - centre.z;
  return x * x + y * y + z * z <= client.view->radius * client.view->radius;
}

}  // namespace

void SpectatorView::describe(Client& client, std::span<const ObjectView> objects, Stamp now, Update& update) {
  near_.clear();
  for (const ObjectView& object : objects) {
    if (!object.spec.enabled || !is_in_view(client, object.spec.pose.position)) continue;
    const std::uint32_t index = table_.refresh(object.id.number(), object.spec.pose);
    if (index != ObjectTable::none) near_.push_back(index);
  }
  // Objects are in order of number.
  if (client.view) update.origin = quantise(client.view->centre);
  client.known.add_changes(near_, table_, now, client.acknowledged, update);
  add_touching(client, update);
}

// Contacts are in order of their numbers.
void SpectatorView::add_touching(const Client& client, Update& update) const {
  for (const Contact& contact : world_.contacts()) {
    if (contact.phase == Phase::end || !is_in_view(client, contact.point)) continue;
    if (update.touching.size() == max_touching) return;
    update.touching.push_back({contact.a, contact.b});
  }
}

}  // namespace ringfence::gateway
