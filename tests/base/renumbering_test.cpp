#include "base/renumbering.hpp"

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::base {
namespace {

TEST_CASE("positions after a removal are those in a list from which the entries were erased") {
  for (unsigned seed = 0; seed < 100; ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::vector<std::uint32_t> removed, asked, kept;
    for (std::uint32_t position = 0; position < 40; ++position) {
      random() % 3 == 0 ? removed.push_back(position) : kept.push_back(position);
      for (auto times = random() % 3; times > 0; --times) asked.push_back(position);
    }
    Renumbering place(removed);
    for (const std::uint32_t position : asked) {
      const std::uint32_t now = place(position);
      if (now == Renumbering::gone) {
        REQUIRE(std::find(removed.begin(), removed.end(), position) != removed.end());
      } else {
        REQUIRE(kept[now] == position);
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::base
