#include <algorithm>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "broad_phase/sweep_and_prune.hpp"

using namespace ringfence;
using namespace ringfence::broad_phase;
using geometry::Bounds;

namespace {

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

Pairs sorted(std::span<const geometry::CandidatePair> pairs) {
  Pairs out;
  for (const auto& pair : pairs) out.emplace_back(std::min(pair.a, pair.b), std::max(pair.a, pair.b));
  std::sort(out.begin(), out.end());
  return out;
}

struct Boxes {
  std::vector<Bounds> bounds;
  std::vector<std::uint8_t> present, resting, layers;
  std::vector<std::uint32_t> groups, crowds;
};

Pairs brute_force(const Boxes& boxes) {
  Pairs out;
  for (std::uint32_t i = 0; i < boxes.bounds.size(); ++i) {
    for (std::uint32_t j = i + 1; j < boxes.bounds.size(); ++j) {
      const std::uint32_t p = boxes.crowds[i], q = boxes.crowds[j];
      const bool same_crowd = p != 0 && q != 0 && (p & 0x7fffffff) == (q & 0x7fffffff);
      const bool excess = (p >> 31) != 0 || (q >> 31) != 0;
      const bool same_group = boxes.groups[i] != 0 && boxes.groups[i] == boxes.groups[j];
      if (boxes.present[i] != 0 && boxes.present[j] != 0 && touch(boxes.bounds[i], boxes.bounds[j]) &&
          !(same_crowd && excess) && !same_group) {
        out.emplace_back(i, j);
      }
    }
  }
  return out;
}

}  // namespace

TEST_CASE(
    "with any number of crowds, sizes, groups and resting boxes the "
    "pairs are those of brute force") {
  for (const std::uint32_t crowds : {1u, 3u, 16u, 17u, 60u}) {
    for (const bool groups : {false, true}) {
      CAPTURE(crowds);
      std::mt19937 engine(crowds);
      const auto random = [&] { return static_cast<std::uint32_t>(engine()); };
      const std::uint32_t count = 700;
      Boxes boxes;
      const auto box = [&] {
        Bounds b;
        const std::uint32_t size = random() % 40 == 0 ? 1u << 26 : 1u << (17 + random() % 6);
        for (int axis = 0; axis < 3; ++axis) {
          b.lower[axis] = (random() % 64) << 22;
          b.upper[axis] = b.lower[axis] + size;
        }
        return b;
      };
      const auto crowd = [&] {
        return random() % 3 == 0 ? 0u : (1 + random() % crowds) | (random() % 3 == 0 ? 0u : 1u << 31);
      };
      for (std::uint32_t i = 0; i < count; ++i) {
        boxes.bounds.push_back(box());
        boxes.present.push_back(random() % 20 != 0);
        boxes.crowds.push_back(crowd());
        boxes.groups.push_back(groups && random() % 4 == 0 ? 1 + random() % 9 : 0u);
      }
      boxes.resting.assign(count, 0);
      SweepAndPrune sweep(count, 100);
      for (int frame = 0; frame < 40; ++frame) {
        const auto pairs = sweep.find(
            boxes.bounds, boxes.present, boxes.resting, {},
            groups ? std::span<const std::uint32_t>(boxes.groups) : std::span<const std::uint32_t>(), boxes.crowds);
        REQUIRE(sorted(pairs) == brute_force(boxes));
        // Most boxes rest from now on; some move, others join or leave a crowd.
        boxes.resting.assign(count, 1);
        for (int i = 0; i < (frame % 10 < 5 ? 200 : 20); ++i) {
          const std::uint32_t slot = random() % count;
          boxes.resting[slot] = 0;
          if (random() % 3 == 0) {
            boxes.crowds[slot] = crowd();
          } else {
            boxes.bounds[slot] = box();
          }
        }
      }
    }
  }
}

TEST_CASE("a crowd on one spot is in pairs with all that touch it, and with nothing else") {
  std::mt19937 engine(5);
  const auto random = [&] { return static_cast<std::uint32_t>(engine()); };
  constexpr std::uint32_t crowded = 300;
  for (const std::uint32_t others : {0u, 1u, 40u, 2500u, 9000u}) {
    CAPTURE(others);
    Boxes boxes;
    SweepAndPrune sweep(100, 100);
    for (int frame = 0; frame < 6; ++frame) {
      boxes = {};
      const std::uint32_t spot = 1u << 31;
      for (std::uint32_t i = 0; i < crowded + others; ++i) {
        const bool in_crowd = i < crowded;
        Bounds b;
        for (int axis = 0; axis < 3; ++axis) {
          b.lower[axis] = in_crowd ? spot + random() % 99 : random() % 12 << 28;
          b.upper[axis] = b.lower[axis] + (in_crowd ? 1000 : random() % (1u << 28));
        }
        boxes.bounds.push_back(b);
        boxes.crowds.push_back(in_crowd ? 3u | (i < 20 ? 0u : 1u << 31) : 0u);
      }
      boxes.present.assign(crowded + others, 1);
      boxes.resting.assign(crowded + others, 0);
      boxes.groups.assign(crowded + others, 0);
      REQUIRE(sorted(sweep.find(boxes.bounds, boxes.present, boxes.resting, {}, {}, boxes.crowds)) ==
              brute_force(boxes));
    }
  }
}

TEST_CASE("crowds may begin and end with the sweep") {
  Boxes boxes;
  boxes.bounds.assign(50, Bounds{{5, 5, 5}, {9, 9, 9}});
  boxes.present.assign(50, 1);
  boxes.resting.assign(50, 0);
  const std::vector<std::uint32_t> crowds(50, 7u | 1u << 31);
  SweepAndPrune sweep(50, 10);
  CHECK(sweep.find(boxes.bounds, boxes.present, boxes.resting).size() == 50 * 49 / 2);
  CHECK(sweep.find(boxes.bounds, boxes.present, boxes.resting, {}, {}, crowds).empty());
  CHECK(sweep.find(boxes.bounds, boxes.present, boxes.resting).size() == 50 * 49 / 2);
}
