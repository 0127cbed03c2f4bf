#include "nodes/user/interest_reader.hpp"

#include <cmath>
#include <memory>
#include <random>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/host/host_records.hpp"

namespace ringfence::nodes {
namespace {

constexpr double side = 60, interest = 9;

/// Some threads of user nodes that publish what their user nodes host. Each user node has avatars and other objects.
struct Crowd {
  struct Thread {
    HostPublication publication{0, interest};
    std::vector<std::unique_ptr<Host>> hosts;
    std::vector<OwnStates> own;
  };

  Crowd(std::size_t count, std::size_t users, std::uint64_t seed) : random(seed) {
    for (std::size_t i = 0; i < count; ++i) {
      threads.push_back(std::make_unique<Thread>());
      for (std::size_t user = 0; user < users; ++user) add_user(*threads.back());
      publications.relays[1].push_back(&threads.back()->publication.published);
      publications.relays[0].push_back(&threads.back()->publication.published);
    }
  }
  void add_user(Thread& thread) {
    thread.hosts.push_back(std::make_unique<Host>(nullptr, 8));
    for (std::size_t i = below(7); i-- > 0;) {
      messages::HandOverRecord record = record_of(++objects);
      record.category = static_cast<std::uint16_t>(below(3) != 0 ? Category::avatar : Category::active);
      thread.hosts.back()->adopt(record, nullptr);
    }
    thread.own.emplace_back();
  }
  /// All objects are anywhere, some of them absent, and published.
  void publish(std::uint64_t frame) {
    for (const auto& thread : threads) {
      UserStates& states = thread->publication.users;
      states.clear();
      thread->publication.publication.begin(frame);
      for (std::size_t user = 0; user < thread->hosts.size(); ++user) {
        Host& host = *thread->hosts[user];
        thread->own[user] = {states.size(), static_cast<std::uint32_t>(host.size())};
        const Vec3d about = anywhere(side);
        for (std::size_t i = 0; i < host.size(); ++i) {
          const Vec3d by = anywhere(below(2) == 0 ? 1 : 30);
          const Pose pose{{about.x + by.x, about.y + by.y, about.z + by.z}, {}};
          const bool present = below(6) != 0;
          (void)host.place(host[i].object.number, pose, present);
          present ? states.add({host[i].object.number, 0, pose}) : states.add_absent();
        }
      }
      states.publish(thread->publication.publication);
      note_published(thread->publication.published, frame);
    }
  }
  Vec3d anywhere(double within) { return {within * uniform(), within * uniform(), within * uniform()}; }
  std::size_t below(std::size_t end) { return random() % end; }
  double uniform() { return static_cast<double>(random() >> 11) * 0x1p-53; }

  std::mt19937_64 random;
  Publications publications;
  std::vector<std::unique_ptr<Thread>> threads;
  ObjectNumber objects = 0;
};

bool is_present(const Hosted& object) { return (object.object.flags & messages::flag_present) != 0; }

bool is_near_avatar(const Host& host, const Vec3d& p) {
  for (std::size_t i = 0; i < host.size(); ++i) {
    const Vec3d& q = host[i].pose.position;
    const bool near =
        std::abs(p.x - q.x) <= interest && std::abs(p.y - q.y) <= interest && std::abs(p.z - q.z) <= interest;
    if (is_present(host[i]) && host[i].category == static_cast<std::uint16_t>(Category::avatar) && near) return true;
  }
  return false;
}

/// Returns the number of states that were near an avatar.
std::size_t check_reading(std::size_t threads, std::size_t users) {
  const std::uint64_t seed = 20265;
  CAPTURE(seed);
  CAPTURE(threads);
  Crowd crowd(threads, users, seed);
  InterestReader reader(crowd.publications, interest);
  std::size_t found = 0;
  for (std::uint64_t frame = 1; frame < 8; ++frame) {
    crowd.publish(frame);
    for (const auto& thread : crowd.threads) {
      reader.begin(frame, &thread->publication);
      for (std::size_t user = 0; user < thread->hosts.size(); ++user) {
        const Host& host = *thread->hosts[user];
        std::set<ObjectNumber> seen;
        for (const auto states : reader.read(host, thread->own[user]).spans()) {
          REQUIRE_FALSE(states.empty());
          for (const PublishedState& state : states) REQUIRE(seen.insert(state.number).second);
        }
        for (std::size_t i = 0; i < host.size(); ++i) REQUIRE(seen.count(host[i].object.number) == 0);
        for (const auto& other : crowd.threads) {
          for (const auto& of : other->hosts) {
            for (std::size_t i = 0; of.get() != &host && i < of->size(); ++i) {
              const Hosted& object = (*of)[i];
              if (!is_present(object)) {
                REQUIRE(seen.count(object.object.number) == 0);
              } else if (is_near_avatar(host, object.pose.position)) {
                REQUIRE(seen.count(object.object.number) == 1);
                ++found;
              }
            }
          }
        }
      }
    }
  }
  return found;
}

TEST_CASE("a user node reads all states near its avatars, each once, and none of its own") {
  CHECK(check_reading(3, 40) > 1000);
  CHECK(check_reading(150, 1) > 1000);  // publications are found by a tree of two levels and more
}

TEST_CASE("a user node without an avatar reads nothing, nor does any without interest") {
  Crowd crowd(1, 10, 4);
  crowd.publish(1);
  InterestReader reader(crowd.publications, 0);
  reader.begin(1, nullptr);
  CHECK(reader.read(*crowd.threads[0]->hosts[0], {}).spans().empty());
  InterestReader other(crowd.publications, interest);
  other.begin(1, nullptr);
  CHECK(other.read(Host(nullptr, 1), {}).spans().empty());
}

}  // namespace
}  // namespace ringfence::nodes
