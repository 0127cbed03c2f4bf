#include "nodes/hosting.hpp"

#include <algorithm>

namespace ringfence::nodes {

using messages::Endpoint;

void Hosting::change(ObjectTable& objects, std::uint32_t slot, Endpoint to) {
  ObjectRow& row = objects.row(slot);
  changes_.push_back({slot, row.host, to});
  row.host = to;
}

std::span<const Rehosting> Hosting::settle(ObjectTable& objects, const regions::RegionMap& map,
                                           std::span<const UserNumber> users, bool users_changed) {
  changes_.clear();
  if (deployment_ == Deployment::user && users_changed && !users.empty()) {
    share_out(objects, users);
    return changes_;
  }
  // Only what moved, appeared or was orphaned in this cut can be without a host; all of it is listed as moved, but for
  // what a departed user node hosted.
  const auto give = [&](std::uint32_t slot) {
    ObjectRow& row = objects.row(slot);
    const bool orphan = row.host.is_user() && !std::binary_search(users.begin(), users.end(), row.host.number());
    if (!row.alive || row.category == static_cast<std::uint16_t>(Category::fixed) ||
        (row.host != Endpoint::none() && !orphan)) {
      return;
    }
    if (row.category == static_cast<std::uint16_t>(Category::avatar)) {
      change(objects, slot, Endpoint::user(row.user));
    } else if (deployment_ == Deployment::user_collision) {
      change(objects, slot, Endpoint::node(node_at(row.pose.position, map)));
    } else if (deployment_ == Deployment::user && !users.empty()) {
      change(objects, slot, Endpoint::user(users[next_user_++ % users.size()]));
    } else {
      change(objects, slot, Endpoint::server());
    }
  };
  if (users_changed) {
    for (std::uint32_t slot = 0; slot < objects.slots(); ++slot) {
      give(slot);
    }
  } else {
    for (const std::uint32_t slot : objects.moved()) {
      give(slot);
    }
  }
  return changes_;
}

// Nobody keeps more than an equal share, rounded up; what is over goes to those who have less.
void Hosting::share_out(ObjectTable& objects, std::span<const UserNumber> users) {
  shares_.assign(users.size(), 0);
  pool_.clear();
  std::size_t total = 0;
  const auto shared = [&](const ObjectRow& row) {
    return row.alive && row.category != static_cast<std::uint16_t>(Category::fixed) &&
           row.category != static_cast<std::uint16_t>(Category::avatar);
  };
  for (std::uint32_t slot = 0; slot < objects.slots(); ++slot) {
    total += shared(objects.row(slot)) ? 1 : 0;
  }
  const std::size_t most = (total + users.size() - 1) / users.size();
  for (std::uint32_t slot = 0; slot < objects.slots(); ++slot) {
    const ObjectRow& row = objects.row(slot);
    if (row.alive && row.category == static_cast<std::uint16_t>(Category::avatar) && row.host == Endpoint::none()) {
      change(objects, slot, Endpoint::user(row.user));
    }
    if (!shared(row)) {
      continue;
    }
    const auto at = row.host.is_user() ? std::lower_bound(users.begin(), users.end(), row.host.number()) : users.end();
    const bool connected = at != users.end() && *at == row.host.number();
    const auto user = static_cast<std::size_t>(at - users.begin());
    if (connected && shares_[user] < most) {
      ++shares_[user];
    } else {
      pool_.push_back(slot);
    }
  }
  std::size_t user = 0;
  for (const std::uint32_t slot : pool_) {
    while (shares_[user] >= most) {
      user = (user + 1) % users.size();
    }
    ++shares_[user];
    change(objects, slot, Endpoint::user(users[user]));
    user = (user + 1) % users.size();
  }
}

}  // namespace ringfence::nodes
