#include <map>
#include <random>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "broad_phase/all_pairs.hpp"
#include "broad_phase/box_worlds.hpp"
#include "broad_phase/sweep_and_prune.hpp"

namespace ringfence::broad_phase::test {
namespace {

using geometry::Bounds;

// A world over many frames: some boxes move, some appear and disappear, the table grows and shrinks.
struct Simulation {
  const BoxWorld& world;
  std::mt19937_64 random;
  std::vector<Bounds> boxes;
  std::vector<std::uint8_t> present, resting;

  void resize(std::size_t count) {
    const std::size_t before = boxes.size();
    boxes.resize(count);
    present.resize(count, 1);
    resting.resize(count, 0);
    for (std::size_t i = before; i < count; ++i) {
      boxes[i] = world.draw(random);
      resting[i] = 0;
    }
  }
  void move(double share, unsigned toggled_of_thousand) {
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      const bool moves = static_cast<double>(random() % 1000) < share * 1000;
      const bool toggles = random() % 1000 < toggled_of_thousand;
      if (moves) boxes[i] = world.draw(random);
      if (toggles) present[i] ^= 1;
      resting[i] = moves || toggles ? std::uint8_t{0} : static_cast<std::uint8_t>(1 + random() % 255);
    }
  }
};

TEST_CASE("the pairs match brute force over many frames in which boxes move, rest, appear and disappear") {
  for (const BoxWorld& world : box_worlds()) {
    const std::uint64_t seed = 1234;
    CAPTURE(world.name);
    CAPTURE(seed);
    Simulation simulation{world, std::mt19937_64(seed), {}, {}, {}};
    SweepAndPrune sweep(16, 16);
    simulation.resize(250);
    for (int frame = 0; frame < 40; ++frame) {
      CAPTURE(frame);
      REQUIRE(difference(sweep.find(simulation.boxes, simulation.present, simulation.resting),
                         all_pairs(simulation.boxes, simulation.present)) == "");
      const double shares[] = {0.1, 0.02, 0, 0.5, 1, 0.05, 0, 0};
      simulation.move(shares[frame / 5], frame % 3 == 0 ? 20 : 0);
      if (frame % 9 == 8) simulation.resize(100 + simulation.random() % 400);
    }
  }
}

TEST_CASE("a word of a kept pair is what the caller wrote for this pair in the frame before, or 0") {
  const BoxWorld& world = box_worlds()[0];
  Simulation simulation{world, std::mt19937_64(10), {}, {}, {}};
  SweepAndPrune sweep(16, 16);
  simulation.resize(400);
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> written;
  std::size_t kept = 0;
  std::uint32_t next = 1;
  for (int frame = 0; frame < 80; ++frame) {
    CAPTURE(frame);
    sweep.begin(simulation.boxes, simulation.present, simulation.resting);
    const auto words = sweep.kept_words();
    std::size_t at = 0;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> writing;
    for (auto found = sweep.next(7); !found.empty(); found = sweep.next(7)) {
      for (const geometry::CandidatePair& pair : found) {
        if (at == words.size()) continue;
        REQUIRE(simulation.resting[pair.a] != 0);
        REQUIRE(simulation.resting[pair.b] != 0);
        const std::pair key(pair.a, pair.b);
        if (words[at] != 0) {
          REQUIRE(written.count(key) == 1);
          REQUIRE(words[at] == written[key]);
          ++kept;
        }
        words[at] = writing[key] = next++;
        ++at;
      }
    }
    REQUIRE(at == words.size());
    written = writing;
    const double shares[] = {0.1, 0.02, 0, 0.5, 0.05, 1, 0, 0.01};
    simulation.move(shares[frame / 10], frame % 3 == 0 ? 20 : 0);
    if (frame % 11 == 10) simulation.resize(300 + simulation.random() % 300);
  }
  CHECK(kept > 100);
}

TEST_CASE("without resting flags the pairs are the same") {
  const BoxWorld& world = box_worlds()[0];
  Simulation simulation{world, std::mt19937_64(8), {}, {}, {}};
  simulation.resize(400);
  SweepAndPrune with_flags(400, 400), without_flags(400, 400);
  const std::vector<std::uint8_t> none(400);
  for (int frame = 0; frame < 20; ++frame) {
    const auto p = canonical(with_flags.find(simulation.boxes, simulation.present, simulation.resting));
    const auto q = canonical(without_flags.find(simulation.boxes, simulation.present, none));
    REQUIRE(difference(p, q) == "");
    simulation.move(0.1, 10);
  }
}

TEST_CASE("resting boxes that leave the table are removed, and their slots can be reused") {
  const BoxWorld& world = box_worlds()[0];
  Simulation simulation{world, std::mt19937_64(9), {}, {}, {}};
  SweepAndPrune sweep(10, 10);
  for (const std::size_t count : {300, 300, 300, 20, 300, 0, 300, 300, 1}) {
    simulation.resize(count);
    CAPTURE(count);
    REQUIRE(difference(sweep.find(simulation.boxes, simulation.present, simulation.resting),
                       all_pairs(simulation.boxes, simulation.present)) == "");
    simulation.move(0, 0);
  }
}

}  // namespace
}  // namespace ringfence::broad_phase::test
