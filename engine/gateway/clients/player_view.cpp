#include "gateway/clients/player_view.hpp"

#include <algorithm>

namespace ringfence::gateway {

void sort_by_number(std::vector<std::uint32_t>& indices, const ObjectTable& table) {
  std::ranges::sort(indices, {}, [&](std::uint32_t index) { return table[index].number; });
  indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
}

void PlayerView::find_near(const Client& client, const Vec3d& centre) {
  const double interest = world_.config().interest, limit = interest * interest;
  const ObjectNumber own = client.avatar.number();
  const auto add = [&](ObjectNumber number, const Pose& pose) {
    if (const std::uint32_t index = table_.refresh(number, pose); index != ObjectTable::none) near_.push_back(index);
  };
  for (const std::span<const SeenState> states : world_.seen_by(client.user)) {
    for (const SeenState& state : states) {
      const double x = state.pose.position.x - centre.x, y = state.pose.position.y - centre.y,
                   z = state.pose.position.z - centre.z;
      if (x * x + y * y + z * z <= limit && state.number != own) add(state.number, state.pose);
    }
  }
  static_objects_.near(centre, interest, [&](const StaticObjects::Entry& entry) { add(entry.number, entry.pose); });
  sort_by_number(near_, table_);
}

void PlayerView::describe(Client& client, Stamp now, Update& update) {
  near_.clear();
  const ObjectView avatar = world_.object(client.avatar);
  if (avatar.id) {
    const Pose& pose = avatar.spec.pose;
    update.own = OwnState{client.avatar.number(), avatar.spec.shape, pose, world_.state(client.avatar)};
    update.origin = quantise(pose.position);
    find_near(client, pose.position);
  }
  client.known.add_changes(near_, table_, now, client.acknowledged, update);
  client.contacts.add_contacts(world_.collisions_of(client.user), client.avatar.number(), now, client.acknowledged,
                               update);
}

}  // namespace ringfence::gateway
