#include "nodes/cd_node/region_objects.hpp"

#include <map>
#include <random>
#include <set>

#include <doctest/doctest.h>

namespace ringfence::nodes {
namespace {

TEST_CASE("a node knows exactly the objects that it received and that were not removed") {
  constexpr unsigned seed = 5;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  RegionObjects known(8, true);
  std::map<std::uint32_t, messages::PositionRecord> model;
  std::map<std::uint32_t, std::uint32_t> places;     // by slot: result of the last set()
  std::set<std::uint32_t> changed;                   // slots set since the last settle()
  std::map<std::uint32_t, base::FrameStamp> stamps;  // by slot: frame of the last set()
  std::set<std::uint32_t> inner;  // slots that were inner at the last note_inner() and are known since
  const auto draw = [&] {
    messages::PositionRecord record;
    record.object.slot = static_cast<std::uint32_t>(random() % 200);
    record.object.number = static_cast<ObjectNumber>(1 + random());
    record.pose.position = {static_cast<double>(random() % 100), 2, 3};
    record.bounds.lower[0] = static_cast<std::uint32_t>(random());
    record.shape = static_cast<ShapeNumber>(random() % 7);
    record.layer = static_cast<std::uint16_t>(random() % 32);
    record.category = static_cast<std::uint16_t>(random() % 4);
    record.group = static_cast<std::uint32_t>(random() % 5);
    record.object.generation = static_cast<std::uint32_t>(random());
    record.user_data = random();
    return record;
  };
  for (int round = 0; round < 20000; ++round) {
    CAPTURE(round);
    known.begin_frame(static_cast<std::uint64_t>(round));
    switch (random() % 8) {
      case 0:
      case 1:
      case 2:
      case 3: {
        const messages::PositionRecord record = draw();
        // The index of the last set(): still right, gone, or of another object now.
        const auto was = places.try_emplace(record.object.slot, RegionObjects::none).first;
        was->second = known.set(
            record, record.bounds, [&] { return PairFilter::of(record.layer, record.group % 2 == 1, record.group); },
            static_cast<NextHost>(record.layer % 4), record.layer % 3 == 0, was->second);
        REQUIRE(known.find(record.object.slot) == was->second);
        REQUIRE(known.find(record.object.slot, static_cast<std::uint32_t>(random() % 300)) == was->second);
        model[record.object.slot] = record;
        changed.insert(record.object.slot);
        stamps[record.object.slot] = static_cast<base::FrameStamp>(round);
        break;
      }
      case 7:
        if (random() % 100 == 0) {
          known.clear();
          model.clear();
          changed.clear();
          inner.clear();
        } else if (random() % 2 == 0) {
          known.note_inner();
          inner.clear();
          for (const auto& [slot, record] : model) {
            if (record.layer % 3 == 0) inner.insert(slot);
          }
        } else {
          known.settle();
          changed.clear();
        }
        break;
      default: {
        const auto slot = static_cast<std::uint32_t>(random() % 230);
        known.remove(slot);
        model.erase(slot);
        changed.erase(slot);
        inner.erase(slot);
      }
    }
    REQUIRE(known.size() == model.size());
    REQUIRE(known.bodies().size() == model.size());
    REQUIRE(known.bounds().size() == model.size());
    REQUIRE(known.resting().size() == model.size());
    REQUIRE(known.present().size() == model.size());
    if (round % 16 != 0) {
      continue;
    }
    for (std::uint32_t slot = 0; slot < 230; ++slot) {
      const auto at = model.find(slot);
      const std::uint32_t i = known.find(slot);
      REQUIRE((i == RegionObjects::none) == (at == model.end()));
      if (i == RegionObjects::none) {
        continue;
      }
      REQUIRE(known.slot(i) == slot);
      REQUIRE(known.bodies()[i].number == at->second.object.number);
      REQUIRE(known.bodies()[i].shape == at->second.shape);
      REQUIRE(known.bodies()[i].generation == at->second.object.generation);
      REQUIRE(known.bodies()[i].layer == at->second.layer);
      REQUIRE(known.bodies()[i].user_data == at->second.user_data);
      REQUIRE(known.bodies()[i].pose == at->second.pose);
      REQUIRE(known.bounds()[i] == at->second.bounds);
      const unsigned fixed = at->second.group % 2 == 1 ? broad_phase::fixed_object : 0;
      REQUIRE(known.layers()[i] == (at->second.layer | fixed));
      if (!known.groups().empty()) REQUIRE(known.groups()[i] == at->second.group);
      REQUIRE((at->second.group == 0 || !known.groups().empty()));
      REQUIRE(known.next_host(i) == static_cast<NextHost>(at->second.layer % 4));
      REQUIRE(known.inner(i) == (at->second.layer % 3 == 0));
      REQUIRE(known.was_inner(i) == (inner.count(slot) != 0));
      REQUIRE(known.numbers()[i] == known.bodies()[i].number);
      REQUIRE(known.present()[i] == 1);
      REQUIRE(known.changed()[i] >= stamps[slot]);
      REQUIRE((known.changed()[i] == stamps[slot] || i != places[slot]));  // another index is a change
      if (changed.count(slot) != 0) {
        REQUIRE(known.resting()[i] == 0);  // an object that rests for the sweep has not changed
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes
