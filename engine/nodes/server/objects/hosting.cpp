#include "nodes/server/objects/hosting.hpp"

#include <algorithm>

#include "base/release_memory.hpp"

namespace ringfence::nodes {

using messages::Endpoint;

void Hosting::change(ObjectTable& objects, std::uint32_t slot, Endpoint to) {
  changes_.push_back({slot, objects.host(slot), to});
  objects.set_host(slot, to);
}

std::span<const HostChange> Hosting::settle(ObjectTable& objects, const regions::RegionMap& map,
                                            std::span<const UserNumber> users, bool users_changed) {
  base::clear_and_release(changes_);
  if (deployment_ == Deployment::user && users_changed && !users.empty()) {
    even_out(objects, users);
    return changes_;
  }
  // Only an object that moved, appeared or lost its host at this cut can have no host. All such objects are in moved(),
  // except those of a user node that has left.
  const auto give = [&](std::uint32_t slot) {
    const ObjectRow& row = objects.row(slot);
    const Endpoint host = objects.host(slot);
    const bool orphan = host.is_user() && !std::binary_search(users.begin(), users.end(), host.number());
    if (!objects.alive(slot) || row.category == static_cast<std::uint16_t>(Category::fixed) ||
        (host != Endpoint::none() && !orphan)) {
      return;
    }
    if (row.category == static_cast<std::uint16_t>(Category::avatar)) {
      change(objects, slot, Endpoint::user(objects.origin(slot).user));
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

// Gives all users equal shares, which differ by at most one object. The larger shares go to users that already host
// more objects. Each user keeps as many of its objects as its share allows, and only the other objects change hosts. No
// assignment of equal shares changes the hosts of fewer objects.
void Hosting::even_out(ObjectTable& objects, std::span<const UserNumber> users) {
  const auto shared = [&](std::uint32_t slot) {
    const ObjectRow& row = objects.row(slot);
    return objects.alive(slot) && row.category != static_cast<std::uint16_t>(Category::fixed) &&
           row.category != static_cast<std::uint16_t>(Category::avatar);
  };
  const auto user_of = [&](std::uint32_t slot) {
    const Endpoint host = objects.host(slot);
    if (!host.is_user()) {
      return users.size();
    }
    const auto at = std::lower_bound(users.begin(), users.end(), host.number());
    return at != users.end() && *at == host.number() ? static_cast<std::size_t>(at - users.begin()) : users.size();
  };
  shares_.assign(users.size(), 0);
  std::size_t total = 0;
  for (std::uint32_t slot = 0; slot < objects.slots(); ++slot) {
    if (!shared(slot)) {
      continue;
    }
    ++total;
    if (const std::size_t user = user_of(slot); user != users.size()) {
      ++shares_[user];
    }
  }
  set_shares(total);

  pool_.clear();
  for (std::uint32_t slot = 0; slot < objects.slots(); ++slot) {
    const bool avatar = objects.row(slot).category == static_cast<std::uint16_t>(Category::avatar);
    if (objects.alive(slot) && avatar && objects.host(slot) == Endpoint::none()) {
      change(objects, slot, Endpoint::user(objects.origin(slot).user));
    }
    if (!shared(slot)) {
      continue;
    }
    const std::size_t user = user_of(slot);
    if (user != users.size() && shares_[user] > 0) {
      --shares_[user];
    } else {
      pool_.push_back(slot);
    }
  }
  std::size_t user = 0;
  for (const std::uint32_t slot : pool_) {
    while (shares_[user] == 0) {
      user = (user + 1) % users.size();
    }
    --shares_[user];
    change(objects, slot, Endpoint::user(users[user]));
    user = (user + 1) % users.size();
  }
}

// Replaces the number of objects that each user node hosts by its share; the shares add up to `total`.
void Hosting::set_shares(std::size_t total) {
  const std::size_t least = total / shares_.size();
  std::size_t larger = total % shares_.size();
  for (std::size_t& share : shares_) {
    const bool more = share > least && larger > 0;
    larger -= more ? 1 : 0;
    share = more ? least + 1 : least;
  }
  // If too few users host more than the smaller share, the first users get the remaining larger shares.
  for (std::size_t& share : shares_) {
    const bool more = share <= least && larger > 0;
    larger -= more ? 1 : 0;
    share = more ? least + 1 : share;
  }
}

}  // namespace ringfence::nodes
