#include "nodes/server/objects/hosting.hpp"

#include <algorithm>
#include <map>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::nodes {
namespace {

using messages::Endpoint;

/// The host assignment of a cut without a server: objects and users come and go at random.
struct Cut {
  Cut(Deployment kind, unsigned seed) : deployment(kind), random(seed), hosting(kind, space) {}

  void spawn() {
    ObjectSpec spec;
    spec.number = ++numbers;
    spec.pose.position = {uniform(-20, 120), uniform(-20, 120), uniform(-20, 120)};
    const std::uint64_t kind = random() % 8;
    if (kind == 0) {
      spec.category = Category::fixed;
    } else if (kind < 3 && !users.empty()) {
      spec.category = Category::avatar;
      spec.user = UserId(users[random() % users.size()]);
    } else {
      spec.category = kind % 2 == 0 ? Category::active : Category::non_active;
    }
    live.push_back(objects.add(ObjectId::of(spec.number, 1), spec));
  }
  void end(std::size_t at) {
    objects.end(live[at]);
    live.erase(live.begin() + static_cast<std::ptrdiff_t>(at));
  }
  void disconnect(UserNumber user) {
    for (std::size_t i = live.size(); i-- > 0;) {
      if (objects.origin(live[i]).user == user) {
        end(i);
      }
    }
    users.erase(std::find(users.begin(), users.end(), user));
  }
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }

  Deployment deployment;
  std::mt19937_64 random;
  geometry::FixedSpace space{{0, 0, 0}, {100, 100, 100}};
  regions::RegionMap map{{{2, 2, 2}}, 7};
  ObjectTable objects{16, 0};
  Hosting hosting;
  std::vector<UserNumber> users;
  std::vector<std::uint32_t> live;
  ObjectNumber numbers = 0;
};

bool is_shared(const ObjectRow& row) {
  return row.category == static_cast<std::uint16_t>(Category::active) ||
         row.category == static_cast<std::uint16_t>(Category::non_active);
}

void check_hosts(const Cut& cut) {
  for (const std::uint32_t slot : cut.live) {
    const ObjectRow& row = cut.objects.row(slot);
    const Endpoint host = cut.objects.host(slot);
    CAPTURE(row.object.number);
    if (row.category == static_cast<std::uint16_t>(Category::fixed)) {
      REQUIRE(host == Endpoint::none());
    } else if (row.category == static_cast<std::uint16_t>(Category::avatar)) {
      REQUIRE(host == Endpoint::user(cut.objects.origin(slot).user));
    } else if (cut.deployment == Deployment::user && !cut.users.empty()) {
      REQUIRE(host.is_user());
      REQUIRE(std::binary_search(cut.users.begin(), cut.users.end(), host.number()));
    } else if (cut.deployment == Deployment::user_collision) {
      std::uint32_t point[3];
      cut.space.point(row.pose.position, point);
      REQUIRE(host == Endpoint::node(cut.map.owner_at(point)));
    } else {
      REQUIRE(host.is_server());
    }
  }
}

/// Least number of changes until the shares of `users` differ by at most one: gives the larger shares greedily to the
/// users who host most.
std::size_t least_changes(std::vector<std::size_t> hosted, std::size_t total) {
  std::sort(hosted.rbegin(), hosted.rend());
  const std::size_t least = total / hosted.size();
  const std::size_t larger = total % hosted.size();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < hosted.size(); ++i) {
    kept += std::min(hosted[i], least + (i < larger ? 1 : 0));
  }
  return total - kept;
}

TEST_CASE("every object that can move has exactly one host after every cut: that of the deployment") {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const unsigned seed : {1u, 2u, 3u}) {
      CAPTURE(name_of(deployment));
      CAPTURE(seed);
      Cut cut(deployment, seed);
      for (int frame = 0; frame < 150; ++frame) {
        CAPTURE(frame);
        cut.objects.settle();
        bool users_changed = false;
        if (frame % 3 == 0 && cut.random() % 2 == 0) {
          const auto user = static_cast<UserNumber>(cut.random() % 9);
          const auto at = std::lower_bound(cut.users.begin(), cut.users.end(), user);
          if (at != cut.users.end() && *at == user) {
            cut.disconnect(user);
          } else {
            cut.users.insert(at, user);
          }
          users_changed = true;
        }
        for (std::uint64_t n = cut.random() % 8; n > 0; --n) {
          cut.spawn();
        }
        for (std::uint64_t n = cut.random() % 5; n > 0 && !cut.live.empty(); --n) {
          cut.end(cut.random() % cut.live.size());
        }
        std::map<std::uint32_t, Endpoint> before;
        std::vector<std::size_t> hosted(cut.users.size(), 0);
        std::size_t total = 0;
        for (const std::uint32_t slot : cut.live) {
          const Endpoint host = cut.objects.host(slot);
          before[slot] = host;
          if (is_shared(cut.objects.row(slot))) {
            ++total;
            const auto at =
                host.is_user() ? std::lower_bound(cut.users.begin(), cut.users.end(), host.number()) : cut.users.end();
            if (at != cut.users.end() && *at == host.number()) {
              ++hosted[static_cast<std::size_t>(at - cut.users.begin())];
            }
          }
        }
        const auto changes = cut.hosting.settle(cut.objects, cut.map, cut.users, users_changed);
        check_hosts(cut);
        // The list contains each change once, with the previous host.
        std::map<std::uint32_t, HostChange> listed;
        for (const HostChange& change : changes) {
          REQUIRE(listed.emplace(change.slot, change).second);
        }
        std::size_t moved_shares = 0;
        for (const auto& [slot, from] : before) {
          const Endpoint to = cut.objects.host(slot);
          REQUIRE((listed.count(slot) != 0) == (from != to));
          if (from != to) {
            REQUIRE(listed[slot].from == from);
            REQUIRE(listed[slot].to == to);
            moved_shares += is_shared(cut.objects.row(slot)) ? 1 : 0;
            listed.erase(slot);
          }
        }
        REQUIRE(listed.empty());
        if (deployment == Deployment::user && users_changed && !cut.users.empty()) {
          std::vector<std::size_t> shares(cut.users.size(), 0);
          for (const std::uint32_t slot : cut.live) {
            if (is_shared(cut.objects.row(slot))) {
              const auto at = std::lower_bound(cut.users.begin(), cut.users.end(), cut.objects.host(slot).number());
              ++shares[static_cast<std::size_t>(at - cut.users.begin())];
            }
          }
          const auto [least, most] = std::minmax_element(shares.begin(), shares.end());
          REQUIRE(*most - *least <= 1);
          REQUIRE(moved_shares == least_changes(hosted, total));
        }
      }
    }
  }
}

TEST_CASE("a user node that connects last gets its share even if no other user exceeds its share rounded up") {
  Cut cut(Deployment::user, 1);
  cut.users = {0, 1, 2};
  for (int i = 0; i < 9; ++i) {
    ObjectSpec spec;
    spec.number = ++cut.numbers;
    cut.live.push_back(cut.objects.add(ObjectId::of(spec.number, 1), spec));
  }
  cut.hosting.settle(cut.objects, cut.map, cut.users, true);
  cut.objects.settle();
  cut.users = {0, 1, 2, 3};
  CHECK(cut.hosting.settle(cut.objects, cut.map, cut.users, true).size() == 2);
  const auto of_last = std::count_if(cut.live.begin(), cut.live.end(),
                                     [&](std::uint32_t slot) { return cut.objects.host(slot) == Endpoint::user(3); });
  CHECK(of_last == 2);
}

}  // namespace
}  // namespace ringfence::nodes
