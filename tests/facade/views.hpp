#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include "ringfence/world.hpp"

namespace ringfence::test {

inline double distance(const Vec3d& p, const Vec3d& q) {
  return std::sqrt((p.x - q.x) * (p.x - q.x) + (p.y - q.y) * (p.y - q.y) + (p.z - q.z) * (p.z - q.z));
}

/// Requires that in the last frame each of `users` read the state of every present, non-static object of others within
/// its interest, once and with the current pose, and no state of its own or of static objects. Also requires that the
/// relayed states were counted. Precondition: at least one frame was run, and no frame is running.
inline void require_views(const World& world, const std::vector<UserId>& users) {
  const WorldConfig& config = world.config();
  std::map<ObjectNumber, ObjectView> objects;
  for (const ObjectView& view : world.objects()) objects[view.spec.number] = view;
  std::map<ObjectNumber, std::set<UserId>> unseen;
  for (const UserId user : users) {
    CAPTURE(user);
    std::set<ObjectNumber> seen;
    for (const auto run : world.seen_by(user)) {
      for (const SeenState& state : run) {
        CAPTURE(state.number);
        REQUIRE(seen.insert(state.number).second);
        const auto at = objects.find(state.number);
        REQUIRE(at != objects.end());
        const ObjectSpec& spec = at->second.spec;
        REQUIRE(spec.pose == state.pose);
        REQUIRE(spec.enabled);
        REQUIRE(spec.category != Category::fixed);
        REQUIRE(spec.user != user);
      }
    }
    std::vector<Vec3d> eyes;
    for (const auto& [number, view] : objects) {
      if (view.spec.user == user && view.spec.enabled) eyes.push_back(view.spec.pose.position);
    }
    for (const auto& [number, view] : objects) {
      const ObjectSpec& spec = view.spec;
      const bool near = std::any_of(eyes.begin(), eyes.end(), [&](const Vec3d& eye) {
        return distance(eye, spec.pose.position) <= config.interest * (1 - 1e-9);
      });
      const bool other = spec.enabled && spec.category != Category::fixed && spec.user != user;
      if (other && near && seen.count(number) == 0) unseen[number].insert(user);
    }
  }
  for (const auto& entry : unseen) {
    const ObjectNumber number = entry.first;
    const std::set<UserId>& who = entry.second;
    CAPTURE(number);
    // In deployment `user` a user node hosts some objects without a user, and does not read their states. No other
    // reason is valid.
    REQUIRE(config.deployment == Deployment::user);
    REQUIRE(objects[number].spec.user == no_user);
    REQUIRE(who.size() == 1);
  }
  const bool relays = config.deployment != Deployment::user && config.interest > 0 && !users.empty();
  const auto relayed = std::count_if(objects.begin(), objects.end(), [](const auto& entry) {
    const ObjectSpec& spec = entry.second.spec;
    return spec.enabled && (spec.category == Category::active || spec.category == Category::non_active);
  });
  // The count can be larger: it also includes the states that CD nodes send to the server.
  REQUIRE((!relays || world.report().traffic[static_cast<std::size_t>(Traffic::state)].records >=
                          static_cast<std::uint64_t>(relayed)));
}

/// The user numbers 0 to `count` - 1, for worlds in which no user leaves.
inline std::vector<UserId> first_users(std::uint32_t count) {
  std::vector<UserId> users;
  for (std::uint32_t user = 0; user < count; ++user) users.emplace_back(user);
  return users;
}

}  // namespace ringfence::test
