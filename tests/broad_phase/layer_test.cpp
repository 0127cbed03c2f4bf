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
