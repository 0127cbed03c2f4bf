#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "broad_phase/all_pairs.hpp"
#include "broad_phase/box_worlds.hpp"
#include "broad_phase/sweep_and_prune.hpp"
#include "geometry/every_target.hpp"

namespace ringfence::broad_phase::test {
namespace {

LayerMasks draw_masks(std::mt19937_64& random) {
  LayerMasks masks{};
  for (unsigned p = 0; p < 32; ++p)
    for (unsigned q = p; q < 32; ++q)
      if (random() % 3 == 0) {
        masks[p] |= 1u << q;
        masks[q] |= 1u << p;
      }
  return masks;
}

TEST_CASE("pairs whose layers do not collide are never found, in any world or instruction set") {
  ringfence::test::on_every_target([] {
    for (const BoxWorld& world : box_worlds()) {
      for (const std::size_t count : {2, 65, 700}) {
        const std::uint64_t seed = 31 + count;
        CAPTURE(world.name);
        CAPTURE(count);
        CAPTURE(seed);
        std::mt19937_64 random(seed);
        const LayerMasks masks = draw_masks(random);
        SweepAndPrune sweep(0, 0, masks);
        const auto boxes = draw_boxes(world, count, random);
        std::vector<std::uint8_t> layers(count), present(count, 1), resting(count, 0);
        for (auto& layer : layers) layer = static_cast<std::uint8_t>(random() % 32);
        CHECK(difference(sweep.find(boxes, present, resting, layers),
                         filter_by_layers(all_pairs(boxes, present), layers, masks)) == "");
      }
    }
  });
}

TEST_CASE("layers also apply between resting and moving boxes, and may change with moving boxes") {
  for (const BoxWorld& world : box_worlds()) {
    const std::uint64_t seed = 77;
    CAPTURE(world.name);
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    const LayerMasks masks = draw_masks(random);
    SweepAndPrune sweep(16, 16, masks);
    auto boxes = draw_boxes(world, 300, random);
    std::vector<std::uint8_t> layers(boxes.size()), resting(boxes.size(), 0);
    const std::vector<std::uint8_t> present(boxes.size(), 1);
    for (int frame = 0; frame < 24; ++frame) {
      CAPTURE(frame);
      const auto some = sweep.find(boxes, present, resting, layers);
      REQUIRE(difference(some, filter_by_layers(all_pairs(boxes, present), layers, masks)) == "");
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        const bool moves = random() % 10 == 0;
        resting[i] = moves ? 0 : 1;
        if (!moves) continue;
        boxes[i] = world.draw(random);
        layers[i] = static_cast<std::uint8_t>(random() % 32);
      }
    }
  }
}

/// Those of `pairs` that are not both static and not of one group.
std::vector<geometry::CandidatePair> filter_by_type(std::vector<geometry::CandidatePair> pairs,
                                                    const std::vector<std::uint8_t>& layers,
                                                    const std::vector<std::uint32_t>& groups) {
  std::erase_if(pairs, [&](const geometry::CandidatePair& pair) {
    const bool both_static = layers[pair.a] >= 128 && layers[pair.b] >= 128;
    return both_static || (!groups.empty() && groups[pair.a] != 0 && groups[pair.a] == groups[pair.b]);
  });
  return pairs;
}

TEST_CASE("two static objects, and objects of one group, are no pair, in any world or instruction set") {
  ringfence::test::on_every_target([] {
    for (const BoxWorld& world : box_worlds()) {
      const std::uint64_t seed = 78;
      CAPTURE(world.name);
      CAPTURE(seed);
      std::mt19937_64 random(seed);
      const std::size_t count = 500;
      const LayerMasks masks = draw_masks(random);
      const auto boxes = draw_boxes(world, count, random);
      const std::vector<std::uint8_t> present(count, 1), resting(count, 0);
      std::vector<std::uint8_t> fixed(count), layers(count);
      std::vector<std::uint32_t> groups(count);
      for (std::size_t i = 0; i < count; ++i) {
        fixed[i] = random() % 2 == 0 ? fixed_object : 0;
        layers[i] = static_cast<std::uint8_t>(random() % 32 | fixed[i]);
        groups[i] = random() % 3 == 0 ? static_cast<std::uint32_t>(random() % 4) : 0;
      }
      const auto all = all_pairs(boxes, present);
      const std::vector<std::uint32_t> none;
      CHECK(difference(SweepAndPrune(0, 0).find(boxes, present, resting, fixed), filter_by_type(all, fixed, none)) ==
            "");
      CHECK(difference(SweepAndPrune(0, 0).find(boxes, present, resting, fixed, groups),
                       filter_by_type(all, fixed, groups)) == "");
      std::vector<std::uint8_t> plain;
      for (const std::uint8_t layer : layers) plain.push_back(layer & layer_number);
      CHECK(difference(SweepAndPrune(0, 0, masks).find(boxes, present, resting, layers, groups),
                       filter_by_layers(filter_by_type(all, layers, groups), plain, masks)) == "");
    }
  });
}

TEST_CASE("static objects and groups are filtered between resting and moving boxes, and groups may change") {
  for (const BoxWorld& world : box_worlds()) {
    const std::uint64_t seed = 79;
    CAPTURE(world.name);
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    SweepAndPrune sweep(16, 16);
    auto boxes = draw_boxes(world, 300, random);
    std::vector<std::uint8_t> layers(boxes.size()), resting(boxes.size(), 0), present(boxes.size(), 1);
    std::vector<std::uint32_t> groups(boxes.size());
    for (std::size_t i = 0; i < boxes.size(); ++i) layers[i] = i % 3 != 0 ? fixed_object : 0;
    for (int frame = 0; frame < 30; ++frame) {
      CAPTURE(frame);
      const auto found = sweep.find(boxes, present, resting, layers, groups);
      REQUIRE(difference(found, filter_by_type(all_pairs(boxes, present), layers, groups)) == "");
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        const bool changes = random() % 10 == 0;
        resting[i] = changes ? 0 : 1;
        if (!changes) continue;
        groups[i] = static_cast<std::uint32_t>(random() % 3);
        present[i] = random() % 8 != 0;
        if (layers[i] == 0) boxes[i] = world.draw(random);
      }
    }
  }
}

TEST_CASE("a heap has no pairs if no layers collide, and all pairs if all do") {
  std::mt19937_64 random(4);
  const auto boxes = draw_boxes(box_worlds()[0], 200, random);
  const std::vector<std::uint8_t> present(200, 1), resting(200, 0), layers(200, 31);
  CHECK(SweepAndPrune(200, 200, LayerMasks{}).find(boxes, present, resting, layers).empty());
  SweepAndPrune sweep(200, 200);
  CHECK(difference(sweep.find(boxes, present, resting, layers), all_pairs(boxes, present)) == "");
}

}  // namespace
}  // namespace ringfence::broad_phase::test
