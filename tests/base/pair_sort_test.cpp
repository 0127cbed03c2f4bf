// The sort of pairs, compared with a stable standard sort.
#include "base/pair_sort.hpp"

#include <algorithm>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::base {
namespace {

using Key = std::pair<ObjectNumber, ObjectNumber>;

TEST_CASE("pairs are sorted by (a, b) for any numbers") {
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u, 6u}) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    PairSort order;
    for (const std::size_t size : {0u, 1u, 2u, 63u, 64u, 65u, 66u, 500u, 5000u}) {
      CAPTURE(size);
      order.clear();
      std::vector<std::pair<Key, std::uint32_t>> model;
      // Two numbers up to 10^7 leave 16 bits of a 64-bit entry for the position; two numbers up to 2^32 leave none.
      const std::uint64_t ranges[] = {0xffffffffu, 4000, 3, 10'000'000};
      const std::uint64_t range = ranges[seed % 4];
      for (std::uint32_t i = 0; i < size; ++i) {
        const auto a = static_cast<ObjectNumber>(1 + random() % range);
        const auto b = static_cast<ObjectNumber>(1 + random() % range);
        order.add(a, b);
        model.push_back({{a, b}, i});
      }
      order.sort();
      std::stable_sort(model.begin(), model.end(), [](const auto& p, const auto& q) { return p.first < q.first; });
      REQUIRE(order.size() == size);
      std::vector<bool> seen(size, false);
      for (std::size_t i = 0; i < size; ++i) {
        const std::uint32_t at = order.at(i);
        REQUIRE(at < size);
        REQUIRE_FALSE(seen[at]);
        seen[at] = true;
        REQUIRE(order.key_at(i) == PairSort::key(model[i].first.first, model[i].first.second));
        // Equal keys may be in any order; real contacts have no equal keys.
        const auto original = std::find_if(model.begin(), model.end(), [&](const auto& m) { return m.second == at; });
        if (size <= 500) {
          REQUIRE(original->first == model[i].first);
        } else if (i > 0 && range > 4000) {
          REQUIRE(model[i].second == at);  // all keys differ here
        }
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::base
