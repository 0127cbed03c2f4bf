// Steps the three roles by hand and checks which messages are sent where and when, which role hosts which object, and
// which hosts are notified of which contact.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {
namespace {

/// In about half of the frames an object jumps to a position that depends on its number and the frame: near or far,
/// exactly on a border between cells, or out of bounds.
class JumpingModel : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return 16; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      std::uint64_t jumps[2];
      std::memcpy(jumps, inputs[i].state, sizeof jumps);
      std::mt19937_64 random(inputs[i].number * 1'000'003u + frame);
      if (random() % 2 == 0) {
        continue;
      }
      ++jumps[0];
      jumps[1] += inputs[i].contacts.size();
      outputs[i].pose.position = spot(random);
      std::memcpy(outputs[i].state, jumps, sizeof jumps);
    }
  }
  static Vec3d spot(std::mt19937_64& random) {
    double p[3];
    for (double& x : p) {
      switch (random() % 4) {
        case 0:
          x = 16.0 * static_cast<double>(random() % 5);  // on a border of cells, or of the world
          break;
        case 1:
          x = static_cast<double>(random() % 200) - 68.0;
          break;
        default:
          x = std::uniform_real_distribution<double>(0, 64)(random);
      }
    }
    return {p[0], p[1], p[2]};
  }
};

std::string describe(const HarnessConfig& config) {
  return std::string(name_of(config.deployment)) + ", broad phase " + name_of(config.placement) + ", " +
         std::to_string(config.nodes) + " nodes" + (config.shares_memory ? ", shared memory" : "");
}

template <class Test>
void in_all_configs(const MotionModel* model, Test test) {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const auto& [nodes, shares] : {std::pair{1u, false}, std::pair{3u, false}, std::pair{8u, false},
                                          std::pair{1u, true}, std::pair{3u, true}}) {
        HarnessConfig config;
        config.deployment = deployment;
        config.placement = placement;
        config.nodes = nodes;
        config.shares_memory = shares;
        config.grid = {{2, 2, 2}};
        config.interest = nodes == 3 ? 12 : 0;
        config.model = model;
        CAPTURE(describe(config));
        test(config);
      }
    }
  }
}

/// Spawns small spheres and large ones, which span several cells: one avatar per user, some static and some active
/// objects.
std::vector<ObjectId> populate(TestHarness& harness, std::mt19937_64& random, std::size_t objects, std::size_t users) {
  const ShapeId small = harness.add_shape(Sphere{2.5f});
  const ShapeId large = harness.add_shape(Sphere{20.0f});
  for (UserNumber user = 0; user < users; ++user) {
    harness.connect(user);
  }
  std::vector<ObjectId> ids;
  for (std::size_t i = 0; i < objects; ++i) {
    ObjectSpec spec;
    spec.shape = i % 10 == 3 ? large : small;
    spec.pose.position = JumpingModel::spot(random);
    spec.category = i < users ? Category::avatar : i % 7 == 6 ? Category::fixed : Category::active;
    if (spec.category == Category::avatar) {
      spec.user = UserId(static_cast<std::uint32_t>(i));
    }
    ids.push_back(harness.spawn(spec));
  }
  return ids;
}

using Pairs = std::set<std::pair<ObjectNumber, ObjectNumber>>;

/// Finds the contacts of spheres by brute force. `unsure` gets the pairs that are closer to touching than 10^-4 m, a
/// limit for rounding errors, and `sure` the other contacts.
void brute_force(const TestHarness& harness, Pairs& sure, Pairs& unsure) {
  const ObjectTable& table = harness.table();
  for (std::uint32_t p = 0; p < table.slots(); ++p) {
    for (std::uint32_t q = 0; q < table.slots(); ++q) {
      const ObjectRow& a = table.row(p);
      const ObjectRow& b = table.row(q);
      const bool present =
          table.alive(p) && table.alive(q) && (a.object.flags & b.object.flags & messages::flag_present) != 0;
      const auto fixed = static_cast<std::uint16_t>(Category::fixed);
      if (!present || a.object.number >= b.object.number || (a.category == fixed && b.category == fixed)) {
        continue;
      }
      const auto radius = [&](const ObjectRow& row) {
        return double{std::get<Sphere>(harness.shapes().description(row.shape)).radius};
      };
      const double reach = radius(a) + radius(b);
      const Vec3d &at_a = harness.server().pose(p).position, &at_b = harness.server().pose(q).position;
      const Vec3d d{at_b.x - at_a.x, at_b.y - at_a.y, at_b.z - at_a.z};
      const double apart = std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z) - reach;
      if (std::abs(apart) < 1e-4) {
        unsure.insert({a.object.number, b.object.number});
      } else if (apart < 0) {
        sure.insert({a.object.number, b.object.number});
      }
    }
  }
}

void check_contacts(const TestHarness& harness) {
  Pairs sure, unsure, found;
  brute_force(harness, sure, unsure);
  for (const Contact& contact : harness.contacts()) {
    const std::pair key{contact.a, contact.b};
    REQUIRE(found.insert(key).second);
    REQUIRE((sure.count(key) != 0 || unsure.count(key) != 0));
    // The poses in which the pair was tested are still those of the objects.
    const auto arm = [&](ObjectNumber number) {
      return to_float(contact.point - harness.server().pose(harness.table().find(number)).position);
    };
    REQUIRE(contact.arm_a == arm(contact.a));
    REQUIRE(contact.arm_b == arm(contact.b));
  }
  for (const auto& key : sure) {
    REQUIRE(found.count(key) != 0);
  }
  const FrameReport& report = harness.report();
  REQUIRE(report.tested + report.carried == report.candidates);
  REQUIRE(report.accepted == report.candidates);
  for (const std::uint64_t refused : report.refused) {
    REQUIRE(refused == 0);
  }
}

/// Requires that the message types between two roles occur in the given order and no other types occur.
void check_order(const std::vector<LoggedMessage>& log, Endpoint from, Endpoint to,
                 const std::vector<MessageType>& order) {
  std::size_t at = 0;
  for (const LoggedMessage& seen : log) {
    if (seen.from != from || seen.to != to) {
      continue;
    }
    CAPTURE(std::string(messages::name_of(seen.type())));
    CAPTURE(from.value);
    CAPTURE(to.value);
    while (at < order.size() && order[at] != seen.type()) {
      ++at;
    }
    REQUIRE(at < order.size());
    // Those that end the contacts of a frame are without contacts.
    const bool ends = seen.type() == MessageType::notify && seen.header.count == 0;
    const bool to_all = to.is_user() && (ends || seen.type() == MessageType::frame_begin ||
                                         seen.type() == MessageType::read_publications);
    const bool from_all =
        from.is_user() && (seen.type() == MessageType::published || seen.type() == MessageType::frame_done);
    REQUIRE(seen.header.source == (from_all ? Endpoint::all_users() : from).value);
    REQUIRE(seen.header.destination == (to_all ? Endpoint::all_users() : to).value);
  }
}

/// Index in the log of the first or last message for which `which` is true; -1 if there is none.
template <class Which>
std::ptrdiff_t first_of(const std::vector<LoggedMessage>& log, Which which) {
  const auto at = std::find_if(log.begin(), log.end(), which);
  return at == log.end() ? -1 : at - log.begin();
}
template <class Which>
std::ptrdiff_t last_of(const std::vector<LoggedMessage>& log, Which which) {
  for (std::size_t i = log.size(); i-- > 0;) {
    if (which(log[i])) return static_cast<std::ptrdiff_t>(i);
  }
  return -1;
}

void check_protocol(const TestHarness& harness, const HarnessConfig& config, std::size_t users) {
  using enum MessageType;
  const std::vector<LoggedMessage>& log = harness.log();
  for (NodeNumber node = 0; node < config.nodes; ++node) {
    // Within a process the word that ends the positions is in the log after the first pairs.
    std::vector<MessageType> to_node{drop, adopt, place, notify, frame_begin, ghosts_sent, position_update, pairs};
    if (config.shares_memory) to_node.push_back(position_update);
    to_node.insert(to_node.end(), {correct, frame_end});
    check_order(log, Endpoint::server(), Endpoint::node(node), to_node);
    check_order(log, Endpoint::node(node), Endpoint::server(),
                config.shares_memory ? std::vector{node_state, published, narrow_done, kinds, frame_done}
                                     : std::vector{replica, node_state, ghost_counts, node_state, collision, change,
                                                   contact_counts, narrow_done, kinds, frame_done});
    for (NodeNumber peer = 0; peer < config.nodes; ++peer) {
      check_order(log, Endpoint::node(node), Endpoint::node(peer), {ghost, notify, hand_over});
    }
  }
  for (UserNumber user = 0; user < users; ++user) {
    check_order(log, Endpoint::server(), Endpoint::user(user),
                {drop, adopt, place, notify, refused, frame_begin, read_publications, notify});
    check_order(log, Endpoint::user(user), Endpoint::server(), {state_update, published, frame_done});
  }
  const auto is = [](MessageType type) { return [type](const LoggedMessage& seen) { return seen.type() == type; }; };
  const auto state = [](const LoggedMessage& seen) {
    return seen.type() == state_update || seen.type() == node_state || seen.type() == replica;
  };
  const auto m2 = [](const LoggedMessage& seen) { return seen.type() == position_update || seen.type() == pairs; };
  const auto begin = first_of(log, is(frame_begin));
  // Poses are final before nodes receive positions, and results are complete before any host is notified.
  REQUIRE(last_of(log, state) < first_of(log, m2));
  REQUIRE(first_of(log, is(narrow_done)) > first_of(log, m2));
  const auto m4 = [&](const LoggedMessage& seen) {
    return seen.type() == notify && seen.from.is_server() && &seen > log.data() + last_of(log, m2);
  };
  const auto between_nodes = [&](const LoggedMessage& seen) { return seen.type() == notify && seen.from.is_node(); };
  REQUIRE(last_of(log, is(narrow_done)) < first_of(log, m4));
  if (const auto direct = first_of(log, between_nodes); direct >= 0) {
    REQUIRE(direct > first_of(log, is(frame_end)));
    REQUIRE(direct > last_of(log, is(narrow_done)));
  }
  REQUIRE(begin >= 0);
  // User nodes read only after everything is published.
  REQUIRE((first_of(log, is(read_publications)) >= 0) == (config.interest > 0 && users > 0));
  if (config.interest > 0 && users > 0) {
    REQUIRE(first_of(log, is(read_publications)) > std::max(last_of(log, state), last_of(log, is(published))));
    REQUIRE(last_of(log, is(read_publications)) < first_of(log, m4));
    const bool publish = config.shares_memory && config.deployment == Deployment::user_collision;
    const auto by_node = [&](const LoggedMessage& seen) { return seen.type() == published && seen.from.is_node(); };
    REQUIRE(static_cast<std::uint32_t>(std::count_if(log.begin(), log.end(), by_node)) == (publish ? config.nodes : 0));
  }
  if (const auto m5 = first_of(log, is(hand_over)); m5 >= 0) {
    REQUIRE(m5 > first_of(log, is(frame_end)));
    REQUIRE(config.deployment == Deployment::user_collision);
  }
  for (const LoggedMessage& seen : log) {
    REQUIRE(seen.header.frame == harness.last());
    const bool between_users = !seen.from.is_server() && !seen.to.is_server();
    // User nodes are connected to the server only.
    REQUIRE((!between_users || (seen.from.is_node() && seen.to.is_node())));
  }
}

/// Requires that every host receives exactly the contacts of its objects that it did not find itself, in order and with
/// both poses, and the phases of those that it found. User nodes also receive ended contacts. Returns the number of
/// contacts that nodes read from the lists of other nodes.
std::uint64_t check_notices(const TestHarness& harness, const HarnessConfig& config, std::size_t users,
                            const std::map<ObjectNumber, Endpoint>& hosts_of_ended) {
  const auto host = [&](ObjectNumber number) {
    const std::uint32_t slot = harness.table().find(number);
    if (slot != base::NumberIndex::none) {
      return harness.table().host(slot);
    }
    const auto at = hosts_of_ended.find(number);
    REQUIRE(at != hosts_of_ended.end());
    return at->second;
  };
  std::uint64_t taken = 0;
  std::vector<Endpoint> all;
  for (NodeNumber node = 0; node < config.nodes; ++node) all.push_back(Endpoint::node(node));
  for (UserNumber user = 0; user < users; ++user) all.push_back(Endpoint::user(user));
  for (const Endpoint to : all) {
    std::map<std::pair<ObjectNumber, ObjectNumber>, Contact> expected;
    for (const auto list : {harness.contacts(), harness.ended()}) {
      for (const Contact& contact : list) {
        if (to.is_node() && contact.phase == Phase::end) {
          continue;  // nodes do not receive ended contacts
        }
        if (host(contact.a) == to || host(contact.b) == to) {
          expected[{contact.a, contact.b}] = contact;
        }
      }
    }
    // A node receives only the phase of a contact that it found itself.
    const auto end =
        last_of(harness.log(), [&](const LoggedMessage& seen) { return seen.type() == MessageType::narrow_done; });
    std::vector<messages::CollisionRecord> found;
    std::set<std::uint32_t> begun;
    std::vector<Contact> notified;
    for (std::size_t at = 0; at < harness.log().size(); ++at) {
      const LoggedMessage& seen = harness.log()[at];
      for (std::size_t k = 0; k < seen.header.count; ++k) {
        if (seen.from == to && seen.type() == MessageType::collision) {
          found.push_back(seen.record<messages::CollisionRecord>(k));
        } else if (seen.from == to && seen.type() == MessageType::change) {
          const auto change = seen.record<messages::ChangeRecord>(k);
          if ((change.flags & messages::change_ended) == 0) {
            begun.insert(change.position);
          }
        } else if (seen.to == to && seen.type() == MessageType::correct) {
          REQUIRE(begun.erase(seen.record<messages::CorrectRecord>(k).position) == 1);
        } else if (seen.to == to && seen.type() == MessageType::notify && static_cast<std::ptrdiff_t>(at) > end) {
          notified.push_back(seen.record<Contact>(k));
        }
      }
    }
    const bool hosting_node = to.is_node() && config.deployment == Deployment::user_collision;
    if (hosting_node && config.shares_memory) {
      REQUIRE(found.empty());
      const NodeContacts& node_contacts = *harness.node_contacts(to.number());
      for (std::uint32_t i = 0; i < node_contacts.keys.size(); ++i) {
        const auto key = node_contacts.keys[i];
        const auto own = expected.find({static_cast<ObjectNumber>(key >> 32), static_cast<ObjectNumber>(key)});
        if (own != expected.end()) {
          REQUIRE(own->second.phase == node_contacts.phase(i));
          expected.erase(own);
        }
      }
      // The node has these contacts from the lists of the other nodes.
      const auto known = harness.host(to.number()).contacts().received(harness.last());
      REQUIRE(notified.empty());
      notified.assign(known.begin(), known.end());
      taken += node_contacts.report.taken;
    }
    for (std::size_t i = 0; hosting_node && i < found.size(); ++i) {
      const auto number = [&](std::uint32_t slot) { return harness.table().row(slot).object.number; };
      const auto own = expected.find({number(found[i].slot_a), number(found[i].slot_b)});
      if (own == expected.end()) {
        continue;  // found for other hosts
      }
      const Contact& contact = own->second;
      REQUIRE((contact.phase == Phase::begin) == begun.contains(static_cast<std::uint32_t>(i)));
      REQUIRE(std::memcmp(&contact.depth, &found[i].depth, sizeof(float)) == 0);
      REQUIRE(std::memcmp(&contact.normal, &found[i].normal, sizeof(Vec3f)) == 0);
      const Vec3d origin = harness.table().row(found[i].slot_a).pose.position;
      const Vec3d point = origin + to_double(found[i].point);
      REQUIRE(std::memcmp(&contact.point, &point, sizeof(Vec3d)) == 0);
      expected.erase(own);
    }
    REQUIRE(notified.size() == expected.size());
    if (hosting_node) {  // from several nodes
      std::sort(notified.begin(), notified.end(),
                [](const Contact& p, const Contact& q) { return std::tie(p.a, p.b) < std::tie(q.a, q.b); });
    }
    std::size_t i = 0;
    for (const auto& [key, contact] : expected) {
      REQUIRE(std::memcmp(&contact, &notified[i++], sizeof contact) == 0);
    }
  }
  return taken;
}

TEST_CASE("in every deployment messages follow the order of the frame's steps, and only hosts are notified") {
  const JumpingModel model;
  in_all_configs(&model, [&](const HarnessConfig& config) {
    constexpr unsigned seed = 21;
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    TestHarness harness(config);
    std::vector<ObjectId> ids = populate(harness, random, 60, 4);
    std::uint64_t taken = 0;
    for (int frame = 0; frame < 25; ++frame) {
      CAPTURE(frame);
      std::map<ObjectNumber, Endpoint> hosts_of_ended;
      if (frame > 3 && random() % 3 == 0) {
        const std::size_t at = 4 + random() % (ids.size() - 4);
        hosts_of_ended[ids[at].number()] = harness.table().host(harness.table().find(ids[at].number()));
        harness.destroy(ids[at]);
        ids.erase(ids.begin() + static_cast<std::ptrdiff_t>(at));
      }
      harness.frame();
      check_contacts(harness);
      check_protocol(harness, config, 4);
      taken += check_notices(harness, config, 4, hosts_of_ended);
      harness.require_one_host_each();
    }
    CHECK((taken > 0) == (config.shares_memory && config.nodes > 1 && config.deployment == Deployment::user_collision));
  });
}

TEST_CASE("objects that jump across regions, onto borders and out of bounds, appear and end, always have one host") {
  const JumpingModel model;
  for (const unsigned seed : {1u, 2u, 3u, 4u}) {
    in_all_configs(&model, [&](const HarnessConfig& config) {
      CAPTURE(seed);
      std::mt19937_64 random(seed);
      TestHarness harness(config);
      std::vector<ObjectId> ids = populate(harness, random, 30, 2);
      for (int frame = 0; frame < 30; ++frame) {
        CAPTURE(frame);
        for (std::uint64_t n = random() % 4; n > 0 && ids.size() > 10; --n) {
          const std::size_t at = 2 + random() % (ids.size() - 2);  // not the avatars
          harness.destroy(ids[at]);
          ids.erase(ids.begin() + static_cast<std::ptrdiff_t>(at));
        }
        for (std::uint64_t n = random() % 4; n > 0; --n) {
          ObjectSpec spec;
          spec.pose.position = JumpingModel::spot(random);
          spec.category = random() % 2 == 0 ? Category::active : Category::non_active;
          ids.push_back(harness.spawn(spec));
          if (random() % 5 == 0) {
            harness.place(ids.back(), {JumpingModel::spot(random), {}});  // placed before it was ever hosted
          }
          if (random() % 5 == 0) {
            harness.destroy(ids.back());  // never hosted at all
            ids.pop_back();
          }
        }
        if (random() % 2 == 0) {
          harness.place(ids[random() % ids.size()], {JumpingModel::spot(random), {}});
        }
        harness.frame();
        harness.require_one_host_each();
        check_contacts(harness);
        REQUIRE(harness.table().live() == ids.size());
      }
    });
  }
}

TEST_CASE("an object that is destroyed in the frame after it crossed a border is gone everywhere") {
  class CrossingModel : public MotionModel {
    void move(std::uint64_t frame, std::span<const MotionInput> inputs,
              std::span<MotionOutput> outputs) const override {
      for (std::size_t i = 0; i < inputs.size(); ++i) {
        // In frame 1 the object jumps from the first cell to the last, across all regions between.
        outputs[i].pose.position.x = frame < 1 ? 1 : 63;
      }
    }
  };
  const CrossingModel model;
  HarnessConfig config;
  config.grid = {{3, 0, 0}};
  config.nodes = 8;
  config.model = &model;
  for (const int destroyed_before : {1, 2, 3}) {
    CAPTURE(destroyed_before);
    TestHarness harness(config);
    const ShapeId ball = harness.add_shape(Sphere{1});
    ObjectSpec spec;
    spec.shape = ball;
    spec.pose.position = {1, 1, 1};
    const ObjectId id = harness.spawn(spec);
    for (int frame = 0; frame < 5; ++frame) {
      if (frame == destroyed_before) {
        harness.destroy(id);
      }
      harness.frame();
      harness.require_one_host_each();
      const auto hosts = harness.hosts_of(id.number());
      if (frame >= destroyed_before) {
        REQUIRE(hosts.empty());
        REQUIRE(harness.table().live() == 0);
      } else {
        REQUIRE(hosts.size() == 1);
        REQUIRE(hosts[0] == Endpoint::node(frame < 1 ? 0 : 7));
      }
    }
  }
}

TEST_CASE("an object that spans all regions collides once with each of its neighbours") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    HarnessConfig config;
    config.placement = placement;
    config.nodes = 16;
    config.grid = {{2, 2, 2}};
    TestHarness harness(config);
    const ShapeId ball = harness.add_shape(Sphere{1});
    const ShapeId globe = harness.add_shape(Sphere{60});
    ObjectSpec spec;
    spec.shape = globe;
    spec.pose.position = {32, 32, 32};
    harness.spawn(spec);
    std::size_t balls = 0;
    spec.shape = ball;
    for (double x = 4; x < 64; x += 8) {
      for (double y = 4; y < 64; y += 8) {
        for (double z = 4; z < 64; z += 8) {
          spec.pose.position = {x, y, z};
          harness.spawn(spec);
          ++balls;
        }
      }
    }
    harness.frame();
    check_contacts(harness);
    CHECK(harness.contacts().size() == balls);
    CHECK(harness.report().candidates == balls);
    harness.require_one_host_each();
    // At rest nothing is sent again, and all contacts are still found.
    harness.frame();
    check_contacts(harness);
    CHECK(harness.contacts().size() == balls);
    CHECK(harness.report().traffic[static_cast<std::size_t>(Traffic::m1)].records == 0);
    for (const LoggedMessage& seen : harness.log()) {
      CHECK((seen.type() != MessageType::position_update || seen.header.count == 0));
    }
  }
}

TEST_CASE("when a user node leaves, its objects go to other hosts with their states and contacts") {
  /// Counts its contacts, so that a contact lost or duplicated on the way to a new host changes the count for good.
  class CountingModel : public MotionModel {
   public:
    std::size_t state_bytes() const noexcept override { return 8; }
    void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
      for (std::size_t i = 0; i < inputs.size(); ++i) {
        std::uint64_t hits;
        std::memcpy(&hits, inputs[i].state, 8);
        hits += inputs[i].contacts.size();
        std::memcpy(outputs[i].state, &hits, 8);
        outputs[i].pose.position.x += hits % 2 == 0 ? 0.25 : -0.25;
      }
    }
  };
  const CountingModel model;
  const auto run = [&](Deployment deployment) {
    HarnessConfig config;
    config.deployment = deployment;
    config.model = &model;
    TestHarness harness(config);
    const ShapeId ball = harness.add_shape(Sphere{2});
    for (UserNumber user = 0; user < 4; ++user) {
      harness.connect(user);
    }
    ObjectSpec spec;
    spec.shape = ball;
    for (int i = 0; i < 60; ++i) {
      spec.pose.position = {static_cast<double>(i % 8) * 3 + 20, static_cast<double>(i / 8) * 3 + 20, 32};
      harness.spawn(spec);
    }
    std::vector<std::vector<std::byte>> states;
    for (int frame = 0; frame < 12; ++frame) {
      if (frame == 3) harness.disconnect(1);
      if (frame == 5) harness.connect(7);
      if (frame == 7) {
        harness.disconnect(0);
        harness.disconnect(2);
      }
      if (frame == 8) {
        harness.disconnect(3);
        harness.disconnect(7);  // no user is left: the server takes over
      }
      if (frame == 10) harness.connect(2);
      harness.frame();
      harness.require_one_host_each();
      check_contacts(harness);
      auto& table = const_cast<ObjectTable&>(harness.table());
      std::vector<std::byte> all;
      for (ObjectNumber number = 1; number <= 60; ++number) {
        const std::byte* state = table.state(table.find(number));
        all.insert(all.end(), state, state + 8);
      }
      states.push_back(all);
    }
    return states;
  };
  const auto expected = run(Deployment::user_server);
  CHECK((run(Deployment::user) == expected));
  CHECK((run(Deployment::user_collision) == expected));
}

}  // namespace
}  // namespace ringfence::nodes::test
