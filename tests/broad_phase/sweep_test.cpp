#include <algorithm>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "broad_phase/all_pairs.hpp"
#include "broad_phase/box_worlds.hpp"
#include "broad_phase/kernels.hpp"
#include "broad_phase/sweep_and_prune.hpp"
#include "geometry/every_target.hpp"

namespace ringfence::broad_phase::test {
namespace {

using geometry::Bounds;
using geometry::CandidatePair;

std::string compare(SweepAndPrune& sweep, const std::vector<Bounds>& boxes, const std::vector<std::uint8_t>& present) {
  const std::vector<std::uint8_t> resting(boxes.size());
  return difference(sweep.find(boxes, present, resting), all_pairs(boxes, present));
}

TEST_CASE("the pairs match brute force, each once, in every world, size and instruction set") {
  ringfence::test::on_every_target([] {
    for (const BoxWorld& world : box_worlds()) {
      SweepAndPrune sweep(0, 0);
      for (const std::size_t count : {0, 1, 2, 3, 9, 65, 300, 1200}) {
        const std::uint64_t seed = 77 + count;
        CAPTURE(world.name);
        CAPTURE(count);
        CAPTURE(seed);
        std::mt19937_64 random(seed);
        const auto boxes = draw_boxes(world, count, random);
        CHECK(compare(sweep, boxes, std::vector<std::uint8_t>(count, 1)) == "");
      }
    }
  });
}

TEST_CASE("each instruction set has its own kernels") {
  std::vector<std::size_t> lanes;
  ringfence::test::on_every_target([&] { lanes.push_back(choose_kernels().lanes); });
  CHECK(lanes.front() == choose_kernels().lanes);  // on_every_target starts with the best target
  CHECK(lanes.back() <= 2);
}

TEST_CASE("mixed worlds match brute force") {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    const auto& worlds = box_worlds();
    std::vector<Bounds> boxes;
    for (int parts = 0; parts < 3; ++parts) {
      const auto more = draw_boxes(worlds[random() % worlds.size()], random() % 400, random);
      boxes.insert(boxes.end(), more.begin(), more.end());
    }
    std::shuffle(boxes.begin(), boxes.end(), random);
    SweepAndPrune sweep(100, 100);
    CHECK(compare(sweep, boxes, std::vector<std::uint8_t>(boxes.size(), 1)) == "");
  }
}

TEST_CASE("worlds large enough for many buckets match brute force") {
  for (const char* name : {"small and few", "spot and strays"}) {
    const auto& worlds = box_worlds();
    const auto world = std::find_if(worlds.begin(), worlds.end(), [&](const BoxWorld& w) { return w.name == name; });
    REQUIRE(world != worlds.end());
    std::mt19937_64 random(5);
    auto boxes = draw_boxes(*world, 40000, random);
    // The boxes are made half as large, otherwise there are far more pairs than boxes.
    for (auto& b : boxes)
      for (int a = 0; a < 3; ++a) b.upper[a] = b.lower[a] + (b.upper[a] - b.lower[a]) / 2;
    SweepAndPrune sweep(boxes.size(), 10);
    const std::vector<std::uint8_t> present(boxes.size(), 1), resting(boxes.size(), 0);
    // The oracle is a sweep along x.
    std::vector<std::uint32_t> order(boxes.size());
    for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
    std::sort(order.begin(), order.end(), [&](auto p, auto q) { return boxes[p].lower[0] < boxes[q].lower[0]; });
    std::vector<CandidatePair> expected;
    for (std::size_t i = 0; i < order.size(); ++i)
      for (std::size_t j = i + 1; j < order.size() && boxes[order[j]].lower[0] <= boxes[order[i]].upper[0]; ++j)
        if (geometry::touch(boxes[order[i]], boxes[order[j]])) expected.push_back({order[i], order[j]});
    CAPTURE(world->name);
    CHECK(expected.size() > 1000);
    CHECK(difference(sweep.find(boxes, present, resting), canonical(expected)) == "");
  }
}

TEST_CASE("boxes that share only a corner are a pair; one unit apart they are not") {
  for (int axis = 0; axis < 3; ++axis) {
    Bounds p{{100, 100, 100}, {200, 200, 200}}, q{{200, 200, 200}, {300, 300, 300}};
    const std::vector<std::uint8_t> present(2, 1), resting(2, 0);
    SweepAndPrune sweep(2, 2);
    CHECK(sweep.find(std::vector{p, q}, present, resting).size() == 1);
    ++q.lower[axis];
    CHECK(sweep.find(std::vector{p, q}, present, resting).empty());
  }
}

TEST_CASE("absent boxes have no pairs, even if their bounds are invalid") {
  std::mt19937_64 random(3);
  auto boxes = draw_boxes(box_worlds()[0], 500, random);
  std::vector<std::uint8_t> present(500);
  for (std::size_t i = 0; i < present.size(); ++i) {
    present[i] = static_cast<std::uint8_t>(random() % 3);
    if (present[i] == 0) boxes[i] = {{9, 9, 9}, {1, 1, 1}};
  }
  SweepAndPrune sweep(500, 500);
  CHECK(compare(sweep, boxes, present) == "");
}

TEST_CASE("the portions together are all pairs, and no portion exceeds the requested size") {
  for (const std::size_t most : {std::size_t{1}, std::size_t{7}, std::size_t{1000}, std::size_t{1} << 30}) {
    CAPTURE(most);
    std::mt19937_64 random(11);
    SweepAndPrune sweep(10, 10);
    std::vector<std::uint8_t> resting(900);
    const std::vector<std::uint8_t> present(900, 1);
    auto boxes = draw_boxes(box_worlds()[0], 900, random);
    for (int frame = 0; frame < 4; ++frame) {
      sweep.begin(boxes, present, resting);
      const auto expected = all_pairs(boxes, present);
      // begin() has read the boxes, so a caller may already write those of the next frame.
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        resting[i] = i % 5 != 0;
        if (resting[i] == 0) boxes[i] = box_worlds()[0].draw(random);
      }
      std::vector<CandidatePair> found;
      for (auto portion = sweep.next(most); !portion.empty(); portion = sweep.next(most)) {
        REQUIRE(portion.size() <= most);
        found.insert(found.end(), portion.begin(), portion.end());
      }
      CHECK(sweep.next(most).empty());
      CHECK(difference(found, expected) == "");
    }
  }
}

TEST_CASE("an abandoned sweep does not affect the next one") {
  std::mt19937_64 random(12);
  const auto boxes = draw_boxes(box_worlds()[0], 800, random);
  const std::vector<std::uint8_t> present(800, 1), resting(800, 0), still(800, 1);
  SweepAndPrune sweep(800, 800);
  sweep.begin(boxes, present, resting);
  (void)sweep.next(10);
  CHECK(difference(sweep.find(boxes, present, still), all_pairs(boxes, present)) == "");
  sweep.begin(boxes, present, still);
  (void)sweep.next(3);
  CHECK(difference(sweep.find(boxes, present, still), all_pairs(boxes, present)) == "");
}

}  // namespace
}  // namespace ringfence::broad_phase::test
