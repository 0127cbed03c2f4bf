#include "reference/depth_ranks.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "reference/random_shapes.hpp"

using namespace ringfence;
using namespace ringfence::reference;
using reference_test::Random;

namespace {

using Exact = std::vector<double>;

/// By definition, for exact depths.
bool is_listed(const std::vector<DepthBounds>& pairs, const Exact& depths, std::size_t limit, std::size_t i) {
  const auto precedes = [&](std::size_t k) {
    return depths[k] > depths[i] ||
           (depths[k] == depths[i] && std::pair{pairs[k].a, pairs[k].b} < std::pair{pairs[i].a, pairs[i].b});
  };
  const auto rank = [&](ObjectNumber number) {
    std::size_t before = 0;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      before += (pairs[k].a == number || pairs[k].b == number) && precedes(k) ? 1 : 0;
    }
    return before;
  };
  return rank(pairs[i].a) < limit || rank(pairs[i].b) < limit;
}

std::vector<DepthBounds> random_pairs(Random& random, bool exact) {
  std::vector<DepthBounds> pairs;
  const auto objects = static_cast<ObjectNumber>(3 + random.below(5));
  for (ObjectNumber a = 1; a < objects; ++a) {
    for (ObjectNumber b = a + 1; b <= objects; ++b) {
      const auto depth = static_cast<double>(random.below(4));
      if (!random.one_in(4)) pairs.push_back({a, b, depth, depth + (exact ? 0 : static_cast<double>(random.below(3)))});
    }
  }
  return pairs;
}

}  // namespace

TEST_CASE("with exact depths a pair may be listed if and only if it must be: if it is among the deepest of an object") {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    CAPTURE(seed);
    Random random(seed);
    const auto pairs = random_pairs(random, true);
    Exact depths;
    for (const DepthBounds& pair : pairs) depths.push_back(pair.most);
    for (const std::size_t limit : {1u, 2u, 4u}) {
      const DepthRanks ranks(pairs, limit);
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        const bool listed = is_listed(pairs, depths, limit, i);
        REQUIRE(ranks.may_be_listed(pairs[i]) == listed);
        REQUIRE(ranks.must_be_listed(pairs[i]) == listed);
      }
    }
  }
}

TEST_CASE("within bounds a pair may be listed if it is for some depths, and must be if it is for its worst") {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    CAPTURE(seed);
    Random random(seed);
    const auto pairs = random_pairs(random, false);
    for (const std::size_t limit : {1u, 2u}) {
      const DepthRanks ranks(pairs, limit);
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        Exact best, worst;
        for (const DepthBounds& pair : pairs) best.push_back(pair.least), worst.push_back(pair.most);
        best[i] = pairs[i].most, worst[i] = pairs[i].least;
        REQUIRE(ranks.may_be_listed(pairs[i]) == is_listed(pairs, best, limit, i));
        REQUIRE(ranks.must_be_listed(pairs[i]) == is_listed(pairs, worst, limit, i));
      }
    }
  }
}
