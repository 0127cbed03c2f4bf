#include "nodes/exchange/publication.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <map>
#include <random>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "link/doorbell.hpp"
#include "nodes/exchange/user_states.hpp"
#include "queries/touched_boxes.hpp"

namespace ringfence::nodes {
namespace {

using Written = Publication::Written;
using States = std::map<ObjectNumber, PublishedState>;

/// The table of a writer: objects that move, come and go.
class Table {
 public:
  Table(double side, std::uint64_t seed) : side_(side), random_(seed) {}

  void resize(std::size_t size) {
    entries_.resize(size, PublishedState{});
    for (PublishedState& entry : entries_) {
      if (entry.number == 0) renew(entry);
    }
  }
  /// All move; one in `one_in` entries gets another object, and one in `one_in` has none in this frame.
  void move(std::size_t one_in) {
    for (PublishedState& entry : entries_) {
      Vec3d& p = entry.pose.position;
      p = {p.x + step(), p.y + step(), p.z + step()};
      if (random_() % one_in == 0) renew(entry);
      entry.flags = random_() % one_in == 0 ? absent : 0;
    }
  }
  /// From now on one in `one_in` entries has no state.
  void remove(std::size_t one_in) {
    for (PublishedState& entry : entries_) {
      if (random_() % one_in == 0) entry.flags = absent;
    }
  }
  void place(std::size_t entry, const Vec3d& at) { entries_.at(entry) = {++last_, 0, {at, {}}}; }
  void move_to(std::size_t entry, const Vec3d& at) { entries_.at(entry).pose.position = at; }
  void publish(Publication& publication, std::uint64_t frame) const {
    publication.begin(frame);
    publication.list_first(static_cast<std::uint32_t>(entries_.size()));
    publication.publish([&](std::uint32_t i) { REQUIRE(i < entries_.size()); },
                        [&](std::uint32_t i, PublishedState& to) {
                          to = entries_.at(i);
                          return to.flags == absent ? Written::nothing : Written::state;
                        });
  }
  States states() const {
    States all;
    for (const PublishedState& entry : entries_) {
      if (entry.flags != absent) all[entry.number] = entry;
    }
    return all;
  }
  Vec3d anywhere() { return {side_ * uniform(), side_ * uniform(), side_ * uniform()}; }
  std::size_t below(std::size_t end) { return random_() % end; }

 private:
  static constexpr std::uint32_t absent = 1;

  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  double step() { return 0.4 * uniform() - 0.2; }
  void renew(PublishedState& entry) { entry = {++last_, 0, {anywhere(), {}}}; }

  double side_;
  std::mt19937_64 random_;
  std::vector<PublishedState> entries_;
  ObjectNumber last_ = 0;
};

/// All states, each once.
States all_of(const Publication& publication, std::uint64_t frame) {
  States all;
  for (const PublishedState& state : publication.states(frame)) REQUIRE(all.emplace(state.number, state).second);
  return all;
}

/// The states of the boxes near a place, each once.
States near(const Publication& publication, std::uint64_t frame, const Vec3d& p, double r) {
  States found;
  queries::TouchedBoxes touched;
  const queries::BoxTree& tree = *publication.tree(frame);
  const auto states = publication.states(frame);
  const auto begins = publication.leaf_begins(frame);
  const std::size_t ranges = touched.find(tree, tree.box_of({p.x - r, p.y - r, p.z - r}, {p.x + r, p.y + r, p.z + r}));
  for (std::size_t i = 0; i < ranges; ++i) {
    for (std::size_t at = begins[touched[i].first]; at < begins[touched[i].end]; ++at) {
      REQUIRE(found.emplace(states[at].number, states[at]).second);
    }
  }
  return found;
}

bool is_within(const Vec3d& p, const Vec3d& q, double r) {
  return std::abs(p.x - q.x) <= r && std::abs(p.y - q.y) <= r && std::abs(p.z - q.z) <= r;
}

TEST_CASE("a frame has each state once, and a reader finds all that are near a place, though the table changes") {
  const std::uint64_t seed = 20261;
  CAPTURE(seed);
  constexpr double interest = 3;
  for (const std::size_t kept : {std::size_t{1}, std::size_t{2}}) {
    for (const std::size_t most : {std::size_t{3}, std::size_t{40}, std::size_t{1000}}) {
      CAPTURE(kept);
      CAPTURE(most);
      Table table(20, seed + most);
      Publication publication(most / 2, interest, kept);
      States before;
      for (std::uint64_t frame = 5; frame < 45; ++frame) {
        CAPTURE(frame);
        table.resize(frame % 10 == 0 ? table.below(most + 1) : most);
        table.move(frame % 4 == 0 ? 5 : 500);
        table.publish(publication, frame);
        const States expected = table.states();
        REQUIRE(all_of(publication, frame) == expected);
        if (kept == 2 && frame > 5) REQUIRE(all_of(publication, frame - 1) == before);
        REQUIRE(publication.published(frame - 1) == (kept == 2 && frame > 5));
        for (int i = 0; i < 10; ++i) {
          const Vec3d place = table.anywhere();
          const States found = near(publication, frame, place, interest);
          for (const auto& [number, state] : expected) {
            if (is_within(state.pose.position, place, interest)) REQUIRE(found.count(number) == 1);
          }
        }
        CHECK(publication.is_intact(frame));
        before = expected;
      }
    }
  }
}

/// States that readers at random places list, over those that are within their interest.
double listed_over_within(const Publication& publication, std::uint64_t frame, Table& table, double interest) {
  const States all = table.states();
  std::size_t listed = 0, within = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3d place = table.anywhere();
    listed += near(publication, frame, place, interest).size();
    within += static_cast<std::size_t>(std::count_if(all.begin(), all.end(), [&](const auto& entry) {
      return is_within(entry.second.pose.position, place, interest);
    }));
  }
  CHECK(within > 1000);
  return static_cast<double>(listed) / static_cast<double>(within);
}

TEST_CASE("a reader lists few states that are not near, also after objects have moved and were replaced for long") {
  constexpr double interest = 4;
  Table table(40, 7);
  Publication publication(0, interest);
  table.resize(8000);
  double sum = 0;  // it depends on how long ago all were sorted
  for (std::uint64_t frame = 1; frame <= 200; ++frame) {
    table.move(1000);
    table.publish(publication, frame);
    sum += frame > 180 ? listed_over_within(publication, frame, table, interest) : 0;
  }
  CHECK(sum / 20 < 8);
}

TEST_CASE("objects that leave do not make readers list more of the others that are not near") {
  constexpr double interest = 2;
  Table table(40, 12);
  Publication publication(0, interest);
  table.resize(8000);
  table.publish(publication, 1);
  const double sorted = listed_over_within(publication, 1, table, interest);
  table.remove(20);
  table.publish(publication, 2);  // too early to sort again
  const double left = listed_over_within(publication, 2, table, interest);
  CAPTURE(sorted);
  CAPTURE(left);
  CHECK(left < 1.1 * sorted);
}

TEST_CASE("publications whose objects move are sorted again in frames whose number is a multiple of eight only") {
  for (const std::uint64_t first : {std::uint64_t{1}, std::uint64_t{6}, std::uint64_t{11}}) {
    CAPTURE(first);
    Table table(40, first);
    Publication publication(0, 4);
    table.resize(4000);
    std::vector<std::uint32_t> order;
    std::size_t sorted = 0;
    for (std::uint64_t frame = first; frame < 100; ++frame) {
      CAPTURE(frame);
      table.move(~std::size_t{0});
      table.publish(publication, frame);
      const std::vector<std::uint32_t> now(publication.entries().begin(), publication.entries().end());
      if (frame % 8 == 0) {
        sorted += now == order ? 0 : 1;
      } else if (frame != first) {
        REQUIRE(now == order);
      }
      order = now;
    }
    CHECK(sorted > 1);
  }
}

TEST_CASE("a publication of which most objects have left has few leaves") {
  Table table(40, 13);
  Publication publication(0, 2);
  table.resize(8000);
  for (std::uint64_t frame = 1; frame < 9; ++frame) {
    table.publish(publication, frame);
    const std::size_t states = publication.states(frame).size();
    CAPTURE(frame);
    CHECK(publication.leaf_begins(frame).size() <= states / 4 + 17);
    CHECK(publication.leaf_begins(frame).back() == states);
    table.remove(2);
  }
  CHECK(publication.states(8).size() < 100);
}

TEST_CASE("objects that fall far out of the world do not make readers list what is not near them") {
  constexpr double interest = 4;
  for (const double speed : {0.0, 1e3, 1e9}) {
    CAPTURE(speed);
    Table table(40, 8);
    Publication publication(0, interest);
    table.resize(8000);
    table.place(0, {-1e15, -1e15, -1e15});
    table.place(1, {20, 20, -1e7});
    for (std::uint64_t frame = 1; frame < 300; ++frame) {
      table.move(100'000);
      table.move_to(1, {20, 20, -1e7 - speed * static_cast<double>(frame)});
      table.publish(publication, frame);
    }
    CHECK(listed_over_within(publication, 299, table, interest) < 6);
  }
}

TEST_CASE("an entry that was unlisted is published again when it is listed again") {
  Publication publication(0, 1);
  std::array<bool, 50> exists{};
  std::array<bool, 50> listed{};
  std::mt19937 random(9);
  for (std::uint64_t frame = 1; frame < 60; ++frame) {
    for (std::uint32_t i = 0; i < exists.size(); ++i) {
      if (random() % 8 == 0) exists[i] = !exists[i];
      if (exists[i] && !listed[i]) publication.list(i), listed[i] = true;
    }
    publication.begin(frame);
    publication.publish([](std::uint32_t) {},
                        [&](std::uint32_t i, PublishedState& to) {
                          REQUIRE(listed[i]);
                          if (!exists[i]) {
                            listed[i] = false;
                            return Written::unlisted;
                          }
                          to = {i + 1, 0, {{static_cast<double>(i), 0, 0}, {}}};
                          return Written::state;
                        });
    const States states = all_of(publication, frame);
    for (std::uint32_t i = 0; i < exists.size(); ++i) REQUIRE(states.count(i + 1) == (exists[i] ? 1u : 0u));
  }
}

TEST_CASE("the bounds are the smallest box around all positions, and no box touches those of an empty frame") {
  Table table(50, 3);
  Publication publication(0, 2);
  table.publish(publication, 1);
  const geometry::CornerBox everything{{-1e9, -1e9, -1e9}, {1e9, 1e9, 1e9}};
  CHECK_FALSE(everything.touches(publication.bounds(1)));
  table.resize(300);
  table.publish(publication, 2);
  geometry::CornerBox expected{{1e9, 1e9, 1e9}, {-1e9, -1e9, -1e9}};
  for (const auto& [number, state] : table.states()) {
    const Vec3d& p = state.pose.position;
    Vec3d &low = expected.lower, &high = expected.upper;
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const geometry::CornerBox bounds = publication.bounds(2);
  CHECK(bounds.lower == expected.lower);
  CHECK(bounds.upper == expected.upper);
}

TEST_CASE("a frame that is published again has its new contents, and the frame before is unchanged") {
  Table table(10, 11);
  Publication publication(4, 2);
  table.resize(90);
  table.publish(publication, 7);
  const States before = table.states();
  for (const std::size_t size : {50u, 70u}) {
    table.resize(size);
    table.move(3);
    table.publish(publication, 8);
    CHECK(all_of(publication, 8) == table.states());
    CHECK(all_of(publication, 7) == before);
  }
}

TEST_CASE("only the kept frames can be read, and a reader that was overtaken detects it") {
  Table table(10, 7);
  table.resize(40);
  for (const std::uint64_t kept : {1u, 2u}) {
    CAPTURE(kept);
    Publication publication(4, 2, kept);
    CHECK_FALSE(publication.published(0));
    CHECK(publication.tree(0) == nullptr);
    for (std::uint64_t frame = 3; frame < 9; ++frame) {
      table.move(100);
      table.publish(publication, frame);
    }
    const std::uint64_t oldest = 9 - kept;
    CHECK(publication.is_intact(oldest));
    publication.begin(9);
    CHECK_FALSE(publication.is_intact(oldest));
    CHECK(publication.states(oldest).empty());
    CHECK(publication.tree(oldest) == nullptr);
    CHECK_FALSE(publication.published(9));
    CHECK(publication.published(8) == (kept == 2));
  }
}

TEST_CASE("user states know where each object was published, whoever comes, goes or is absent") {
  std::mt19937 random(5);
  Publication publication(0, 2);
  UserStates users;
  for (std::uint64_t frame = 1; frame < 60; ++frame) {
    std::vector<ObjectNumber> added;  // 0: absent
    for (ObjectNumber number = 1; number <= 100; ++number) {
      if (frame % 7 == 0 && random() % 30 == 0) continue;
      added.push_back(random() % 20 == 0 ? 0 : number);
    }
    publication.begin(frame);
    users.clear();
    for (const ObjectNumber number : added) {
      const Pose pose{{static_cast<double>(number * 37 % 101), static_cast<double>(frame), 0}, {}};
      number == 0 ? users.add_absent() : users.add({number, 0, pose});
    }
    users.publish(publication);
    const auto states = publication.states(frame);
    REQUIRE(states.size() == added.size() - static_cast<std::size_t>(std::count(added.begin(), added.end(), 0u)));
    for (std::uint32_t i = 0; i < added.size(); ++i) {
      if (added[i] == 0) {
        REQUIRE(users.place_of(i) >= states.size());
      } else {
        REQUIRE(states[users.place_of(i)].number == added[i]);
      }
    }
  }
}

TEST_CASE("readers in lock-step with a writer see every frame whole") {
  constexpr std::uint64_t frames = 2000;
  constexpr std::size_t readers = 3, states = 60;
  Publication publication(1, 5);
  std::atomic<std::uint64_t> written{0}, wrong{0};
  std::array<std::atomic<std::uint64_t>, readers> done{};
  std::array<link::Doorbell, readers + 1> bells;
  std::vector<std::thread> threads;
  for (std::size_t reader = 0; reader < readers; ++reader) {
    threads.emplace_back([&, reader] {
      queries::TouchedBoxes touched;
      for (std::uint64_t frame = 1; frame <= frames; ++frame) {
        bells[reader].wait([&] { return written.load(std::memory_order_acquire) >= frame; });
        std::uint64_t sum = 0, count = 0;
        const queries::BoxTree& tree = *publication.tree(frame);
        const std::size_t ranges = touched.find(tree, tree.box_of({0, 0, 0}, {1e6, 1e6, 1e6}));
        const auto all = publication.states(frame);
        const std::size_t end = ranges == 1 ? publication.leaf_begins(frame)[touched[0].end] : 0;
        for (std::size_t i = 0; i < end; ++i) {
          sum += all[i].flags;
          count += all[i].pose.position.x == static_cast<double>(frame) ? 1 : 0;
        }
        if (count != states || sum != states * frame || !publication.is_intact(frame)) wrong.fetch_add(1);
        done[reader].store(frame, std::memory_order_release);
        bells[readers].ring();
      }
    });
  }
  for (std::uint64_t frame = 1; frame <= frames; ++frame) {
    publication.begin(frame);
    publication.list_first(states);
    publication.publish([](std::uint32_t) {},
                        [&](std::uint32_t i, PublishedState& to) {
                          const auto x = static_cast<double>(frame);
                          to = {i + 1, static_cast<std::uint32_t>(frame), {{x, (i * 7919 + x) / 100, 0}, {}}};
                          return Written::state;
                        });
    // The writer may be at most one frame ahead of its readers.
    bells[readers].wait([&] {
      return std::all_of(done.begin(), done.end(),
                         [&](const auto& d) { return d.load(std::memory_order_acquire) + 1 >= frame; });
    });
    written.store(frame, std::memory_order_release);
    for (std::size_t reader = 0; reader < readers; ++reader) bells[reader].ring();
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(wrong.load() == 0);
}

}  // namespace
}  // namespace ringfence::nodes
