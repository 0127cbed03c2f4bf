#include "nodes/server/contacts/border_matches.hpp"

#include <random>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include "base/pair_sort.hpp"

namespace ringfence::nodes::test {
namespace {

TEST_CASE("border matches are the contacts that ended and began, as a set finds them") {
  BorderMatches matches;
  for (unsigned seed = 0; seed < 300; ++seed) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    const auto objects = static_cast<ObjectNumber>(2 + random() % 60);
    const auto key = [&] {
      const auto a = static_cast<ObjectNumber>(1 + random() % objects);
      return base::PairSort::key(a, a + static_cast<ObjectNumber>(1 + random() % objects));
    };
    std::set<std::uint64_t> ended;
    matches.start();
    for (std::size_t node = 0; node < 5; ++node) {
      std::vector<std::uint64_t> keys(random() % 40);
      for (std::uint64_t& one : keys) ended.insert(one = key());
      matches.add_endings(keys);
    }
    REQUIRE(matches.prepare() == !ended.empty());
    if (ended.empty()) continue;
    std::vector<std::pair<NodeNumber, std::uint32_t>> expected;
    std::set<std::uint64_t> passed;
    for (NodeNumber node = 0; node < 5; ++node) {
      std::vector<BorderContact> begun(random() % 40);
      for (BorderContact& contact : begun) {
        contact = {key(), static_cast<std::uint32_t>(random() % 1000)};
        if (ended.count(contact.key) != 0) {
          expected.emplace_back(node, contact.position);
          passed.insert(contact.key);
        }
      }
      matches.match(node, begun);
    }
    matches.finish();
    REQUIRE(matches.matches().size() == expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      REQUIRE(matches.matches()[i].node == expected[i].first);
      REQUIRE(matches.matches()[i].position == expected[i].second);
    }
    REQUIRE(std::vector<std::uint64_t>(matches.passed().begin(), matches.passed().end()) ==
            std::vector<std::uint64_t>(passed.begin(), passed.end()));
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
