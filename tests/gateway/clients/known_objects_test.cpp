// An independent model of a server and a network: objects come, go, move and change; updates and acknowledgements are
// lost, delayed and reordered. Whatever arrives, the client has exactly what the server saw in the frame it has
// applied.
#include "gateway/clients/known_objects.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <random>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include "gateway/client/replica.hpp"
#include "gateway/clients/own_contacts.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {
namespace {

using Random = std::mt19937_64;
using Seen = std::map<ObjectNumber, QuantisedPosition>;

/// A world of balls that are placed at random.
class Balls {
 public:
  Balls() : world_(config()), shape_(world_.add_shape(Sphere{0.01f})), table_(world_) {
    for (ObjectNumber number = 1; number <= 40; ++number) spawn(number);
    CHECK(world_.advance() == Status::ok);
  }

  void change(Random& random) {
    std::vector<ObjectNumber> destroyed;
    for (int i = 0; i < 6; ++i) {
      const auto number = static_cast<ObjectNumber>(1 + random() % 40);
      const ObjectId id = world_.find(number);
      if (!id) {
        if (free_.erase(number) > 0) spawn(number);
      } else if (random() % 8 == 0) {
        if (world_.destroy(id) == Status::ok) destroyed.push_back(number);
      } else {
        const auto coordinate = [&] { return static_cast<double>(random() % 100); };
        CHECK(world_.place(id, {{coordinate(), coordinate(), coordinate()}, {0, 0, 0, 1}}) == Status::ok);
      }
    }
    CHECK(world_.advance() == Status::ok);
    free_.insert(destroyed.begin(), destroyed.end());
  }

  /// Those with x below `limit`, as indices into the table and as the oracle.
  std::vector<std::uint32_t> near(double limit, Seen& seen) {
    table_.begin_frame(world_.frames());
    std::vector<std::uint32_t> indices;
    for (const ObjectView& object : world_.objects()) {
      const Pose& pose = object.spec.pose;
      if (pose.position.x >= limit) continue;
      const std::uint32_t index = table_.refresh(object.id.number(), pose);
      REQUIRE(index != ObjectTable::none);
      indices.push_back(index);
      seen[object.id.number()] = quantise(pose.position);
    }
    return indices;
  }
  const ObjectTable& table() const { return table_; }
  std::uint64_t frames() const { return world_.frames(); }

 private:
  static WorldConfig config() {
    WorldConfig config;
    config.nodes = 0;
    config.bounds_max = {100, 100, 100};
    return config;
  }
  void spawn(ObjectNumber number) {
    ObjectSpec spec;
    spec.number = number;
    spec.shape = shape_;
    spec.pose.position = {static_cast<double>(number), 1, 1};
    CHECK(world_.spawn(spec).status == Status::ok);
  }

  World world_;
  ShapeId shape_;
  ObjectTable table_;
  std::set<ObjectNumber> free_;  ///< numbers of objects that are gone
};

}  // namespace

TEST_CASE("a client that applies any update has what the server saw in its frame, whatever was lost or reordered") {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    CAPTURE(seed);
    Random random(seed);
    const bool is_lossy = seed > 2;
    Balls balls;
    KnownObjects known;
    Replica replica;
    std::map<std::uint64_t, Seen> history;
    std::vector<Update> on_way;
    std::deque<std::uint64_t> acknowledgements;
    Stamp acknowledged = 0;
    std::size_t applied = 0;
    for (int frame = 0; frame < 400; ++frame) {
      balls.change(random);
      if (random() % 5 == 0) continue;  // a slow client gets no update of this frame
      Update update;
      update.frame = balls.frames() - 1;
      update.since = acknowledged == 0 ? 0 : balls.frames() - acknowledged;
      const std::vector<std::uint32_t> near =
          balls.near(static_cast<double>(20 + random() % 60), history[balls.frames()]);
      known.add_changes(near, balls.table(), balls.frames(), acknowledged, update);
      if (!is_lossy || random() % 3 != 0) on_way.push_back(update);
      while (!on_way.empty() && (on_way.size() > 5 || random() % 2 == 0)) {
        const std::size_t at = is_lossy ? random() % on_way.size() : 0;
        if (replica.apply(on_way[at]) == Replica::Outcome::applied) {
          ++applied;
          Seen seen;
          for (const auto& [number, object] : replica.objects()) seen[number] = object.position;
          REQUIRE(seen == history[replica.acknowledgement()]);
          if (!is_lossy || random() % 3 != 0) acknowledgements.push_back(replica.acknowledgement());
        }
        on_way.erase(on_way.begin() + static_cast<std::ptrdiff_t>(at));
      }
      while (!acknowledgements.empty() && random() % 2 == 0) {
        acknowledged = std::max(acknowledged, acknowledgements.front());
        acknowledgements.pop_front();
      }
    }
    CHECK(applied > 100);
    CHECK(known.size() <= 40);
  }
}

TEST_CASE("an update has only what changed since the acknowledged frame") {
  Random random(5);
  Balls balls;
  KnownObjects known;
  Seen seen;
  Update first, second;
  known.add_changes(balls.near(1000, seen), balls.table(), balls.frames(), 0, first);
  CHECK(first.entered.size() == 40);
  const Stamp acknowledged = balls.frames();
  balls.change(random);
  known.add_changes(balls.near(1000, seen), balls.table(), balls.frames(), acknowledged, second);
  CHECK(second.entered.size() + second.moved.size() + second.removed.size() <= 6);
  CHECK(second.entered.size() + second.moved.size() + second.removed.size() >= 1);
}

TEST_CASE("contacts that ended are repeated until they are acknowledged, and ages count the frames") {
  OwnContacts contacts;
  const auto contact = [](ObjectNumber a, ObjectNumber b, Phase phase) {
    Contact made;
    made.a = a;
    made.b = b;
    made.phase = phase;
    made.normal = {1, 0, 0};
    made.depth = 0.25f;
    return made;
  };
  const std::vector<Contact> begins{contact(3, 5, Phase::begin), contact(5, 9, Phase::begin)};
  const std::vector<Contact> goes_on{contact(3, 5, Phase::persist), contact(5, 9, Phase::end)};
  Update update;
  contacts.add_contacts(begins, 5, 10, 9, update);
  REQUIRE(update.contacts.size() == 2);
  CHECK(update.contacts[0].other == 3);
  CHECK(update.contacts[0].phase == Phase::begin);
  CHECK(update.contacts[0].normal == QuantisedNormal{-127, 0, 0});
  CHECK(update.contacts[0].depth == 128);
  CHECK(update.contacts[1].normal == QuantisedNormal{127, 0, 0});
  for (Stamp now = 11; now < 15; ++now) {
    update.clear();
    contacts.add_contacts(goes_on, 5, now, 9, update);
    REQUIRE(update.contacts.size() == 2);
    CHECK(update.contacts[0].phase == Phase::persist);
    CHECK(update.contacts[0].age == now - 10);
    CHECK(update.contacts[1].phase == Phase::end);
    CHECK(update.contacts[1].age == now - 11);
  }
  update.clear();
  contacts.add_contacts(goes_on, 5, 15, 11, update);
  CHECK(update.contacts.size() == 1);
  update.clear();
  contacts.add_contacts({}, 5, 16, 11, update);
  REQUIRE(update.contacts.size() == 1);
  CHECK(update.contacts[0].phase == Phase::end);
}

TEST_CASE("ended contacts that the client does not acknowledge are limited, and the newest are kept") {
  OwnContacts contacts;
  Stamp now = 1;
  Update update;
  for (ObjectNumber other = 10; other < 500; ++other) {
    Contact made;
    made.a = 1;
    made.b = other;
    made.phase = Phase::begin;
    update.clear();
    contacts.add_contacts(std::span(&made, 1), 1, ++now, 0, update);
  }
  CHECK(update.contacts.size() <= OwnContacts::max_ended + 2);
  CHECK(update.contacts.back().other == 499);
}

}  // namespace ringfence::gateway
