// The number index, compared with a standard map.
#include "base/number_index.hpp"

#include <cstdint>
#include <random>
#include <unordered_map>

#include <doctest/doctest.h>

namespace ringfence::base {
namespace {

TEST_CASE("the number index finds what a standard map finds, after any stores and erasures") {
  for (const unsigned seed : {1u, 2u, 3u, 4u}) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    NumberIndex index(seed % 2 == 0 ? 0 : 500);
    std::unordered_map<ObjectNumber, std::uint32_t> model;
    const auto draw = [&]() -> ObjectNumber {
      switch (random() % 4) {
        case 0:
          return static_cast<ObjectNumber>(1 + random() % 300);
        case 1:
          return static_cast<ObjectNumber>(0xffffffffu - random() % 300);
        case 2:
          return static_cast<ObjectNumber>((1 + random() % 300) << 20);  // numbers that share their low bits
        default:
          return static_cast<ObjectNumber>(1 + random() % 0xffffffffu);
      }
    };
    for (int round = 0; round < 40000; ++round) {
      CAPTURE(round);
      const ObjectNumber number = draw();
      // The index grows and shrinks by turns, so that entries are erased from full and from sparse tables.
      if (random() % 100 < (round / 4000 % 2 == 0 ? 70u : 30u)) {
        const auto value = static_cast<std::uint32_t>(random() % 0xffffffffu);
        index.set(number, value);
        model[number] = value;
      } else if (!model.empty() && random() % 2 == 0) {
        const ObjectNumber known = model.begin()->first;
        index.erase(known);
        model.erase(known);
      } else {
        index.erase(number);
        model.erase(number);
      }
      REQUIRE(index.size() == model.size());
      const auto at = model.find(number);
      REQUIRE(index.find(number) == (at == model.end() ? NumberIndex::none : at->second));
      if (round % 1000 == 999) {
        for (const auto& [known, value] : model) {
          REQUIRE(index.find(known) == value);
        }
      }
    }
  }
}

// The numbers are about as sparse as direct entries may be, so that numbers move from the hash table to direct entries.
TEST_CASE("the number index finds everything while its direct entries grow during a rehash") {
  for (unsigned seed = 0; seed < 300; ++seed) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    NumberIndex index(seed % 3 * 20);
    std::unordered_map<ObjectNumber, std::uint32_t> model;
    const std::uint64_t numbers = 400 + random() % 8000;
    for (std::uint32_t round = 0; round < 600; ++round) {
      const auto number = static_cast<ObjectNumber>(1 + random() % numbers);
      if (random() % 5 != 0) {
        index.set(number, round);
        model[number] = round;
      } else {
        index.erase(number);
        model.erase(number);
      }
      REQUIRE(index.size() == model.size());
      const auto at = model.find(number);
      REQUIRE(index.find(number) == (at == model.end() ? NumberIndex::none : at->second));
    }
    for (const auto& [number, value] : model) {
      REQUIRE(index.find(number) == value);
    }
  }
}

}  // namespace
}  // namespace ringfence::base
