// WorldConfig::deepest_contacts, compared with collide() of every pair of objects.
#include <algorithm>
#include <atomic>
#include <map>
#include <memory>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "facade/script.hpp"
#include "ringfence/collide.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 4;

using Pair = std::pair<ObjectNumber, ObjectNumber>;
/// The depths of the contacts of a frame.
using Depths = std::map<Pair, float>;

/// Requires that each object sees exactly the contacts that are listed.
class WatchingModel : public BouncingModel {
 public:
  WatchingModel() : BouncingModel(side) {}
  /// By object: the listed contacts of the frame before, in order. Set between frames.
  std::map<ObjectNumber, std::vector<Pair>> listed;
  mutable std::atomic<std::uint64_t> differences{0}, seen{0};

  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (const MotionInput& input : inputs) {
      std::vector<Pair> pairs;
      for (std::size_t i = 0; i < input.contacts.size(); ++i) {
        pairs.emplace_back(input.contacts[i].a, input.contacts[i].b);
      }
      const auto at = listed.find(input.number);
      differences += pairs == (at == listed.end() ? std::vector<Pair>() : at->second) ? 0 : 1;
      seen += pairs.size();
    }
    BouncingModel::move(frame, inputs, outputs);
  }
};

bool may_touch(const World& world, const ObjectSpec& p, const ObjectSpec& q) {
  const bool both_static = p.category == Category::fixed && q.category == Category::fixed;
  const bool same_group = p.group != 0 && p.group == q.group;
  return p.enabled && q.enabled && !both_static && !same_group &&
         (world.config().layers.mask(p.layer) >> q.layer & 1) != 0;
}

Depths all_contacts(const World& world, const std::vector<PreparedShape>& shapes) {
  Depths depths;
  const auto views = world.objects();
  for (std::size_t i = 0; i < views.size(); ++i) {
    for (std::size_t k = i + 1; k < views.size(); ++k) {
      const ObjectSpec &p = views[i].spec, &q = views[k].spec;
      const PreparedShape &first = shapes[p.shape.number()], &second = shapes[q.shape.number()];
      const Vec3d d{p.pose.position.x - q.pose.position.x, p.pose.position.y - q.pose.position.y,
                    p.pose.position.z - q.pose.position.z};
      const double reach = first.bounding_radius() + second.bounding_radius() + 1e-3;
      if (d.x * d.x + d.y * d.y + d.z * d.z > reach * reach || !may_touch(world, p, q)) continue;
      const CollideResult result = collide(first, p.pose, second, q.pose);
      REQUIRE(result.status == Status::ok);
      if (result.contact) depths[{p.number, q.number}] = result.contact->depth;
    }
  }
  return depths;
}

Depths deepest(const Depths& all, std::size_t limit) {
  std::map<ObjectNumber, std::vector<std::tuple<float, Pair>>> ranks;
  for (const auto& [pair, depth] : all) {
    for (const ObjectNumber number : {pair.first, pair.second}) ranks[number].emplace_back(-depth, pair);
  }
  Depths listed;
  for (auto& [number, ranked] : ranks) {
    std::sort(ranked.begin(), ranked.end());
    for (std::size_t i = 0; i < std::min(limit, ranked.size()); ++i) {
      listed[std::get<1>(ranked[i])] = -std::get<0>(ranked[i]);
    }
  }
  return listed;
}

void require_lists(const World& world, const Depths& before, const Depths& now) {
  REQUIRE(world.contacts().size() == now.size());
  std::size_t i = 0;
  for (const auto& [pair, depth] : now) {
    const Contact& contact = world.contacts()[i++];
    REQUIRE(Pair(contact.a, contact.b) == pair);
    REQUIRE(contact.depth == depth);
    REQUIRE(contact.phase == (before.count(pair) != 0 ? Phase::persist : Phase::begin));
  }
  i = 0;
  for (const auto& [pair, depth] : before) {
    if (now.count(pair) != 0) continue;
    REQUIRE(i < world.ended().size());
    const Contact& contact = world.ended()[i++];
    REQUIRE(Pair(contact.a, contact.b) == pair);
    REQUIRE(contact.depth == depth);
    REQUIRE(contact.phase == Phase::end);
  }
  REQUIRE(i == world.ended().size());
}

// In a deployment in which a user node hosts only its avatars, it receives their contacts, ended ones too.
void require_users(const World& world, const std::vector<UserId>& users) {
  std::map<ObjectNumber, UserId> owners;
  for (const ObjectView& view : world.objects()) owners[view.spec.number] = view.spec.user;
  for (const UserId user : users) {
    std::vector<Pair> expected, got;
    for (const auto list : {world.contacts(), world.ended()}) {
      for (const Contact& contact : list) {
        if (owners[contact.a] == user || owners[contact.b] == user) expected.emplace_back(contact.a, contact.b);
      }
    }
    // An avatar that was destroyed has ended contacts, too, which this test does not look for.
    for (const Contact& contact : world.collisions_of(user)) {
      const bool known = owners[contact.a] == user || owners[contact.b] == user;
      if (contact.phase != Phase::end || known) got.emplace_back(contact.a, contact.b);
    }
    std::sort(expected.begin(), expected.end());
    REQUIRE(got == expected);
  }
}

TEST_CASE("in every deployment and placement the list, its phases, users and models have the deepest contacts alone") {
  WorldConfig base;
  base.bounds_max = {side, side, side};
  base.layers.names = {"solid", "ghost", "wall"};
  base.layers.collide = {{0, 0}, {0, 2}, {1, 2}, {0, 1}};
  base.quotas.colliding_avatars = 0;
  base.balance_by = BalanceBy::pairs;
  for (const std::uint32_t limit : {1u, 2u}) {
    base.deepest_contacts = limit;
    CAPTURE(limit);
    std::vector<std::uint64_t> prints;
    std::vector<Depths> all_of;  // by frame; states and contacts are the same in every world, as the prints say
    in_all_worlds(base, {0u, 1u, 2u, 3u, 5u}, [&](WorldConfig config) {
      const auto model = std::make_shared<WatchingModel>();
      config.motion = model;
      World world(config);
      Script script(world, 77, side);
      std::vector<PreparedShape> shapes;
      for (std::uint32_t shape = 0; shape < world.shape_count(); ++shape) {
        shapes.emplace_back(world.shape(ShapeId(shape)));
      }
      Depths before;
      std::uint64_t unlisted = 0;
      std::vector<std::uint64_t> own_prints;
      for (std::size_t frame = 0; frame < 24; ++frame) {
        CAPTURE(frame);
        if (config.nodes > 1 && frame % 7 == 5) {
          REQUIRE(world.resize(static_cast<std::uint32_t>(1 + frame % 5)) == Status::ok);
        }
        advance(world);
        if (frame == all_of.size()) all_of.push_back(all_contacts(world, shapes));
        const Depths& all = all_of[frame];
        const Depths now = deepest(all, limit);
        REQUIRE(world.report().unlisted == all.size() - now.size());
        require_lists(world, before, now);
        if (config.deployment != Deployment::user) require_users(world, script.users());
        REQUIRE(model->differences == 0);
        model->listed.clear();
        for (const auto& [pair, depth] : now) {
          for (const ObjectNumber number : {pair.first, pair.second}) model->listed[number].push_back(pair);
        }
        unlisted += world.report().unlisted;
        before = now;
        own_prints.push_back(fingerprint(world));
        script.make_requests();
      }
      CHECK(unlisted > 200);
      CHECK(model->seen > 500);
      prints = prints.empty() ? own_prints : prints;
      REQUIRE(own_prints == prints);
    });
  }
}

TEST_CASE("equal depths are ranked by pair, and objects at rest keep the same list") {
  for (const std::uint32_t nodes : {0u, 1u, 3u}) {
    CAPTURE(nodes);
    WorldConfig config;
    config.nodes = nodes;
    config.bounds_max = {8, 8, 8};
    config.deepest_contacts = 2;
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    for (int i = 0; i < 6; ++i) {
      REQUIRE(world.spawn({.shape = ball, .pose = {{4, 4, 4}, {}}}).status == Status::ok);
    }
    for (int frame = 0; frame < 4; ++frame) {
      CAPTURE(frame);
      advance(world);
      std::vector<Pair> pairs;
      for (const Contact& contact : world.contacts()) {
        pairs.emplace_back(contact.a, contact.b);
        CHECK(contact.phase == (frame == 0 ? Phase::begin : Phase::persist));
      }
      CHECK(pairs == std::vector<Pair>{{1, 2}, {1, 3}, {1, 4}, {1, 5}, {1, 6}, {2, 3}, {2, 4}, {2, 5}, {2, 6}});
      CHECK(world.report().unlisted == 6);
      CHECK(world.ended().empty());
    }
  }
}

}  // namespace
}  // namespace ringfence::test
