// Slots, ids and the freeing of CD nodes, without a World.
#include "facade/node_pool.hpp"

#include <atomic>
#include <cstddef>
#include <memory>
#include <thread>
#include <vector>

#include <doctest/doctest.h>
#include <sys/prctl.h>

#include "facade/duplex_channel.hpp"
#include "geometry/shape_table.hpp"

namespace ringfence::facade {
namespace {

using Slots = std::vector<NodeNumber>;

/// A pool with channels that are counted.
class Fixture {
 public:
  Fixture() : pool(setup()) {}

  NodePoolSetup setup() {
    NodePoolSetup setup;
    setup.role.shapes = &shapes_;
    setup.role.space = &space_;
    const auto connect = [this](link::Doorbell* first, link::Doorbell* second) {
      // The deleter counts.
      const std::shared_ptr<DuplexChannel> channel(new DuplexChannel(4096, first, second), [this](DuplexChannel* gone) {
        delete gone;
        --channels;
      });
      ++channels;
      return PoolChannel{channel->first(), channel->second(), channel};
    };
    setup.connect_to_server = [connect](const PoolNode& node, std::size_t) {
      return connect(nullptr, node.worker != nullptr ? &node.worker->bell() : nullptr);
    };
    setup.connect = [connect](const PoolNode&, const PoolNode&, std::size_t) { return connect(nullptr, nullptr); };
    setup.start_worker = [this](Worker& worker) {
      return threads_left-- > 0 && worker.start(halt_, nullptr, Worker::unpinned);
    };
    return setup;
  }
  PoolNode& add(bool own_thread = false) { return pool.add(map_, pool.size() + 1, own_thread); }
  Slots slots_in_use() const {
    Slots slots;
    pool.each([&](const PoolNode& node) { slots.push_back(node.slot); });
    return slots;
  }
  const regions::RegionMap& map() const { return map_; }

  int channels = 0;         ///< that exist
  int threads_left = 1000;  ///< that can be created

 private:
  geometry::ShapeTable shapes_;
  geometry::FixedSpace space_{{0, 0, 0}, {8, 8, 8}};
  regions::RegionMap map_{{{2, 2, 2}}, 1};
  Halt halt_{nullptr};

 public:
  NodePool pool;
};

TEST_CASE("a new node takes the lowest free slot, and its id was never used before") {
  Fixture fixture;
  NodePool& pool = fixture.pool;
  for (NodeNumber node = 0; node < 4; ++node) {
    const PoolNode& added = fixture.add();
    CHECK(added.slot == node);
    CHECK(added.id == node);
  }
  pool.remove(Slots{2, 1});
  CHECK(fixture.slots_in_use() == Slots{0, 3});
  CHECK(pool.size() == 2);
  CHECK(pool.slots() == 4);
  CHECK(pool.at(1) == nullptr);
  CHECK(pool.find(1) == nullptr);
  CHECK(fixture.add().slot == 1);
  CHECK(pool.find(4)->slot == 1);
  CHECK(fixture.add().slot == 2);
  CHECK(fixture.add().slot == 4);
  CHECK(pool.find(6)->slot == 4);
  pool.remove(Slots{0, 1, 2, 3, 4});
  CHECK(pool.size() == 0);
  CHECK(pool.slots() == 0);
  CHECK(fixture.add().id == 7);
}

TEST_CASE("the youngest nodes are those that joined last, wherever they stand") {
  Fixture fixture;
  for (int node = 0; node < 3; ++node) fixture.add();
  fixture.pool.remove(Slots{0});
  fixture.add();
  CHECK(fixture.pool.youngest(0).empty());
  CHECK(fixture.pool.youngest(1) == Slots{0});
  CHECK(fixture.pool.youngest(2) == Slots{0, 2});
  CHECK(fixture.pool.youngest(9) == Slots{0, 2, 1});
}

TEST_CASE("two nodes have the two ends of one channel, and a free slot has none") {
  Fixture fixture;
  for (int node = 0; node < 3; ++node) fixture.add();
  CHECK(fixture.channels == 6);  // three with the server, three between nodes
  fixture.pool.remove(Slots{1});
  fixture.pool.connect();
  const auto of_first = fixture.pool.peers_of(*fixture.pool.at(0));
  const auto of_last = fixture.pool.peers_of(*fixture.pool.at(2));
  REQUIRE(of_first.size() == 3);
  REQUIRE(of_last.size() == 3);
  CHECK(of_first[0].out == nullptr);
  CHECK(of_first[1].out == nullptr);
  REQUIRE(of_first[2].out != nullptr);
  REQUIRE(of_first[2].out->claim(8).size() == 8);
  of_first[2].out->commit(8);
  of_first[2].out->publish();
  CHECK(of_last[0].in->next().size() == 8);
}

TEST_CASE("what a node had is freed after the next frame") {
  Fixture fixture;
  for (int node = 0; node < 3; ++node) fixture.add();
  fixture.pool.remove(Slots{1});
  CHECK(fixture.pool.free_retired());
  CHECK(fixture.pool.retired().size() == 1);
  CHECK(fixture.channels == 4);  // those between nodes have no reader left
  CHECK(fixture.pool.free_retired());
  CHECK(fixture.pool.retired().empty());
  CHECK(fixture.channels == 3);
}

TEST_CASE("nothing of any retired node is freed while the thread of one runs") {
  Fixture fixture;
  REQUIRE(fixture.pool.prepare_threads(3));
  for (int node = 0; node < 3; ++node) fixture.add(true);
  struct Stuck {
    std::atomic<bool> is_in{false}, may_go{false};
    nodes::Step step() {
      is_in = true;
      while (!may_go) std::this_thread::yield();
      return nodes::Step::idle;
    }
  } stuck;
  fixture.pool.at(0)->worker->assign({Steppable::of(stuck)});
  while (!stuck.is_in) std::this_thread::yield();
  const int channels = fixture.channels;
  fixture.pool.remove(Slots{0});
  fixture.pool.connect();
  CHECK_FALSE(fixture.pool.free_retired());
  fixture.pool.remove(Slots{2});
  for (int frame = 0; frame < 3; ++frame) CHECK_FALSE(fixture.pool.free_retired());
  CHECK(fixture.pool.retired().size() == 2);
  CHECK(fixture.channels == channels);
  CHECK(fixture.add().slot == 0);
  stuck.may_go = true;
  while (!fixture.pool.free_retired()) std::this_thread::yield();
  CHECK(fixture.pool.retired().empty());
  CHECK(fixture.channels == 3);  // two with the server, one between the two nodes
}

TEST_CASE("a fallback node stands in the slot of the node that it replaces, under an id of its own, without peers") {
  Fixture fixture;
  fixture.add();
  fixture.add();
  const PoolNode& node = fixture.pool.replace(1, fixture.map());
  CHECK(node.slot == 1);
  CHECK(node.id == 2);
  CHECK(fixture.pool.find(1) == nullptr);
  CHECK(fixture.pool.peers_of(node)[0].out == nullptr);
  REQUIRE(fixture.pool.retired().size() == 1);
  CHECK(fixture.pool.retired()[0]->id == 1);
}

TEST_CASE("if one of several threads cannot be created, none is kept, and a later attempt works") {
  Fixture fixture;
  fixture.threads_left = 2;
  CHECK_FALSE(fixture.pool.prepare_threads(3));
  int threads = 0;
  fixture.pool.each_worker([&](Worker&) { ++threads; });
  CHECK(threads == 0);
  fixture.threads_left = 3;
  REQUIRE(fixture.pool.prepare_threads(3));
  REQUIRE(fixture.pool.prepare_threads(2));  // one too many ends
  fixture.pool.each_worker([&](Worker&) { ++threads; });
  CHECK(threads == 2);
}

TEST_CASE("the kernel's table of sleeping threads is large enough for the threads of a pool before they start") {
  const auto slots = [] { return prctl(78, 2ul, 0ul, 0ul, 0ul); };  // PR_FUTEX_HASH, since Linux 6.16
  std::thread([] {}).join();                                        // a process with one thread has no table
  const int before = slots();
  if (before < 0 || before > 256) {
    MESSAGE("this kernel has one table for all processes, or another test has enlarged that of this process");
    return;
  }
  Fixture fixture;
  const auto threads = static_cast<std::size_t>(2 * before + 64);
  REQUIRE(fixture.pool.prepare_threads(threads));
  CHECK(slots() >= static_cast<int>(threads / 2));
  REQUIRE(fixture.pool.prepare_threads(0));
}

}  // namespace
}  // namespace ringfence::facade
