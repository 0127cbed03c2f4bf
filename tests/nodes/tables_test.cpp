// The flat tables against the standard containers.
#include <algorithm>
#include <cstring>
#include <map>
#include <random>
#include <set>
#include <unordered_map>
#include <vector>

#include <doctest/doctest.h>

#include "base/number_index.hpp"
#include "nodes/server/objects/object_table.hpp"
#include "nodes/server/objects/spawn_order.hpp"

namespace ringfence::nodes {
namespace {

TEST_CASE("an object table keeps every live object by number and slot, and reuses a slot only after a settled frame") {
  for (const std::size_t state_bytes : {0u, 24u}) {
    const unsigned seed = 11 + static_cast<unsigned>(state_bytes);
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    ObjectTable table(4, state_bytes);
    struct Model {
      std::uint32_t slot, generation;
      ObjectSpec spec;
      std::uint8_t mark;
    };
    std::map<ObjectNumber, Model> live;
    std::set<std::uint32_t> ended_now;
    std::uint32_t generation = 0;
    for (int frame = 0; frame < 300; ++frame) {
      CAPTURE(frame);
      table.settle();
      REQUIRE(table.moved().empty());
      ended_now.clear();
      std::set<std::uint32_t> touched, unnotified;
      for (std::uint64_t spawns = random() % 6; spawns > 0; --spawns) {
        ObjectSpec spec;
        spec.number = static_cast<ObjectNumber>(1 + random() % 1000);
        if (live.count(spec.number) != 0) {
          continue;
        }
        spec.enabled = random() % 3 != 0;
        spec.layer = static_cast<std::uint8_t>(random() % 32);
        spec.user_data = random();
        spec.pose.position.x = static_cast<double>(random() % 1000);
        const std::uint32_t slot = table.add(ObjectId::of(spec.number, ++generation), spec);
        REQUIRE(ended_now.count(slot) == 0);  // a row of an object that ended in this frame is still read
        for (const auto& [number, model] : live) {
          REQUIRE(model.slot != slot);
        }
        for (std::size_t k = 0; k < state_bytes; ++k) {
          REQUIRE(table.state(slot)[k] == std::byte{0});
        }
        const auto mark = static_cast<std::uint8_t>(random());
        std::fill_n(table.new_state(slot), state_bytes, std::byte{mark});
        live[spec.number] = {slot, generation, spec, mark};
        touched.insert(slot);
        unnotified.insert(slot);
      }
      for (std::uint64_t ends = random() % 5; ends > 0 && !live.empty(); --ends) {
        const auto at = std::next(live.begin(), static_cast<std::ptrdiff_t>(random() % live.size()));
        const std::uint32_t slot = at->second.slot;
        const messages::ObjectRef ref = table.row(slot).object;
        table.end(slot);
        REQUIRE(table.find(ref) == base::NumberIndex::none);
        REQUIRE(table.present()[slot] == 0);
        REQUIRE(table.row(slot).object.number == at->first);  // readable until the next frame
        ended_now.insert(slot);
        if (touched.insert(slot).second) {
          unnotified.insert(slot);
        }
        live.erase(at);
      }
      if (random() % 2 == 0) {
        const std::size_t before = table.moved().size();
        table.order_moved();
        REQUIRE(table.moved().size() == before);
        REQUIRE((before * 8 < table.slots() || std::is_sorted(table.moved().begin(), table.moved().end())));
      }
      for (auto& [number, model] : live) {
        if (random() % 4 == 0) {
          model.spec.enabled = random() % 2 == 0;
          table.change_row(model.slot).object.flags = model.spec.enabled ? messages::flag_present : 0u;
          if (random() % 2 == 0) {
            table.mark_moved_host_only(model.slot);
            touched.insert(model.slot);
          } else {
            table.mark_moved(model.slot);
            if (touched.insert(model.slot).second) {
              unnotified.insert(model.slot);
            }
          }
        }
      }
      REQUIRE(table.live() == live.size());
      const auto moved = table.moved();
      REQUIRE(moved.size() == touched.size());
      REQUIRE((std::set<std::uint32_t>(moved.begin(), moved.end()) == touched));
      REQUIRE((std::set<std::uint32_t>(table.unnotified().begin(), table.unnotified().end()) == unnotified));
      REQUIRE(table.unnotified().size() == unnotified.size());
      REQUIRE(table.present().size() == table.slots());
      REQUIRE(table.bounds().size() == table.slots());
      std::size_t present = 0;
      for (const auto& [number, model] : live) {
        const ObjectRow& row = table.row(model.slot);
        REQUIRE(table.find(number) == model.slot);
        REQUIRE(table.find(messages::ObjectRef{model.slot, model.generation, number, 0}) == model.slot);
        REQUIRE(table.find(messages::ObjectRef{model.slot, model.generation + 1, number, 0}) ==
                base::NumberIndex::none);
        REQUIRE(table.find(messages::ObjectRef{model.slot, model.generation, number + 1, 0}) ==
                base::NumberIndex::none);
        REQUIRE(table.find(messages::ObjectRef{model.slot + 1, model.generation, number, 0}) ==
                base::NumberIndex::none);
        REQUIRE(table.alive(model.slot));
        REQUIRE(std::uint64_t{table.origin(model.slot).user_data} == model.spec.user_data);
        REQUIRE(table.numbers()[model.slot] == number);
        REQUIRE((table.layers()[model.slot] & broad_phase::layer_number) == model.spec.layer);
        const bool fixed = model.spec.category == Category::fixed;
        REQUIRE(((table.layers()[model.slot] & broad_phase::fixed_object) != 0) == fixed);
        REQUIRE(table.group(model.slot) == model.spec.group);
        REQUIRE(table.hand_over(model.slot).group == model.spec.group);
        REQUIRE(table.hand_over(model.slot).user_data == model.spec.user_data);
        REQUIRE(row.layer == model.spec.layer);
        REQUIRE((table.present()[model.slot] != 0) == model.spec.enabled);
        REQUIRE((table.resting()[model.slot] == 0) == (touched.count(model.slot) != 0));
        for (std::size_t k = 0; k < state_bytes; ++k) {
          REQUIRE(table.state(model.slot)[k] == std::byte{model.mark});
        }
        present += model.spec.enabled ? 1 : 0;
      }
      REQUIRE(static_cast<std::size_t>(std::count(table.present().begin(), table.present().end(), 1)) == present);
    }
    CHECK(table.slots() < 400);  // slots were reused
    CHECK(table.find(messages::ObjectRef{0xffffffffu, 1, 1, 0}) == base::NumberIndex::none);
    CHECK(table.find(ObjectNumber{5000}) == base::NumberIndex::none);
  }
}

TEST_CASE("objects spawned together are ordered so that neighbours stay close, each once") {
  const unsigned seed = 77;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  const geometry::FixedSpace space({0, 0, 0}, {160, 80, 160});
  std::vector<Request> spawns(20000);
  for (Request& spawn : spawns) {
    const auto within = [&](double side) { return static_cast<double>(random() % 1000) * side / 1000; };
    spawn.spec.pose.position = {within(160), within(80), within(160)};
  }
  spawns[7].spec.pose.position = {-1e9, 40, 1e9};  // outside counts as at the edge
  base::SystemVector<PositionedSpawn> scratch;
  const auto order = order_by_position(spawns, space, scratch);
  REQUIRE(order.size() == spawns.size());
  std::set<std::uint32_t> seen;
  for (const PositionedSpawn& placed : order) {
    seen.insert(placed.position);
  }
  CHECK(seen.size() == spawns.size());
  CHECK(*seen.rbegin() == spawns.size() - 1);
  const auto distance = [&](std::uint32_t p, std::uint32_t q) {
    const Vec3d& a = spawns[p].spec.pose.position;
    const Vec3d& b = spawns[q].spec.pose.position;
    return std::sqrt((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y) + (a.z - b.z) * (a.z - b.z));
  };
  // At random two of them are 84 m apart; in rows the next is 8 m away.
  std::size_t near = 0;
  for (std::size_t i = 1; i < order.size(); ++i) {
    near += distance(order[i - 1].position, order[i].position) < 20 ? 1u : 0u;
  }
  CHECK(near > order.size() * 8 / 10);
  CHECK(order_by_position(std::span<const Request>(), space, scratch).empty());
}

}  // namespace
}  // namespace ringfence::nodes
