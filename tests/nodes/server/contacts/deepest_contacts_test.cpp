#include "nodes/server/contacts/deepest_contacts.hpp"

#include <algorithm>
#include <memory>
#include <random>
#include <set>
#include <tuple>
#include <vector>

#include <doctest/doctest.h>

#include "base/pair_sort.hpp"

namespace ringfence::nodes {
namespace {

struct Pair {
  std::uint32_t a, b;  ///< slots; the number of an object is one more
  float depth;
  std::uint64_t key() const { return base::PairSort::key(a + 1, b + 1); }
};

/// The contacts of some nodes.
struct Found {
  std::vector<std::unique_ptr<NodeContacts>> nodes;
  std::vector<std::vector<narrow_phase::PairContact>> touches;

  Found(std::size_t node_count, std::vector<Pair> pairs, std::mt19937_64& random) {
    std::sort(pairs.begin(), pairs.end(), [](const Pair& p, const Pair& q) { return p.key() < q.key(); });
    touches.resize(node_count);
    for (std::size_t node = 0; node < node_count; ++node) nodes.push_back(std::make_unique<NodeContacts>());
    for (const Pair& pair : pairs) {
      const std::size_t node = random() % node_count;
      const auto touch = static_cast<std::uint32_t>(touches[node].size());
      nodes[node]->keys.push_back(pair.key());
      nodes[node]->found.push_back({pair.a, pair.b, 0, 0, touch});
      touches[node].push_back({0, pair.depth, {}, {}});
    }
    for (std::size_t node = 0; node < node_count; ++node) nodes[node]->touches = touches[node].data();
  }
  std::vector<NodeContacts*> pointers() const {
    std::vector<NodeContacts*> list;
    for (const auto& node : nodes) list.push_back(node.get());
    return list;
  }
};

/// By definition: sorts all contacts of each object.
std::set<std::uint64_t> expected_unlisted(const std::vector<Pair>& pairs, std::size_t limit, std::uint32_t slots) {
  std::set<std::uint64_t> listed, unlisted;
  for (std::uint32_t slot = 0; slot < slots; ++slot) {
    std::vector<std::tuple<float, std::uint64_t>> own;
    for (const Pair& pair : pairs) {
      if (pair.a == slot || pair.b == slot) own.emplace_back(-pair.depth, pair.key());
    }
    std::sort(own.begin(), own.end());
    for (std::size_t i = 0; i < std::min(limit, own.size()); ++i) listed.insert(std::get<1>(own[i]));
  }
  for (const Pair& pair : pairs) {
    if (listed.count(pair.key()) == 0) unlisted.insert(pair.key());
  }
  return unlisted;
}

std::set<std::uint64_t> unlisted_keys(const DeepestContacts& deepest, const Found& found) {
  std::set<std::uint64_t> keys;
  for (NodeNumber node = 0; node < found.nodes.size(); ++node) {
    const auto positions = deepest.unlisted(node);
    REQUIRE(std::is_sorted(positions.begin(), positions.end()));
    for (const std::uint32_t position : positions) keys.insert(found.nodes[node]->keys[position]);
  }
  REQUIRE(keys.size() == deepest.size());
  return keys;
}

TEST_CASE(
    "unlisted are the contacts that neither object has among its deepest, whoever found them and with equal depths") {
  DeepestContacts deepest;
  for (unsigned seed = 0; seed < 300; ++seed) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    const auto slots = static_cast<std::uint32_t>(2 + random() % 24);
    const unsigned depths = random() % 2 == 0 ? 3 : 1000;
    const std::uint64_t density = 1 + random() % 3;
    std::vector<Pair> pairs;
    for (std::uint32_t a = 0; a < slots; ++a) {
      for (std::uint32_t b = a + 1; b < slots; ++b) {
        if (random() % density == 0) pairs.push_back({a, b, static_cast<float>(random() % depths)});
      }
    }
    const Found found(1 + random() % 4, pairs, random);
    const auto nodes = found.pointers();
    for (const std::uint32_t limit : {1u, 2u, 5u, 100u}) {
      CAPTURE(limit);
      deepest.rank(limit, nodes);
      REQUIRE(unlisted_keys(deepest, found) == expected_unlisted(pairs, limit, slots));
    }
  }
}

TEST_CASE("depths of 0, also negative ones, are equal, so the pair decides") {
  std::mt19937_64 random(1);
  const std::vector<Pair> pairs = {{0, 1, -0.0f}, {0, 2, 0.0f},  {1, 2, 0.0f},
                                   {0, 3, 0.0f},  {1, 3, -0.0f}, {2, 3, 0.0f}};
  const Found found(1, pairs, random);
  DeepestContacts deepest;
  deepest.rank(1, found.pointers());
  CHECK(unlisted_keys(deepest, found) == std::set{pairs[2].key(), pairs[4].key(), pairs[5].key()});
}

TEST_CASE("without nodes, without contacts and with a limit that no object exceeds nothing is unlisted") {
  std::mt19937_64 random(1);
  DeepestContacts deepest;
  deepest.rank(1, {});
  CHECK(deepest.size() == 0);
  const Found none(2, {}, random);
  deepest.rank(1, none.pointers());
  CHECK(deepest.size() == 0);
  // A star: its middle has many contacts, each other object one.
  std::vector<Pair> star;
  for (std::uint32_t b = 1; b < 9; ++b) star.push_back({0, b, 1});
  const Found found(2, star, random);
  deepest.rank(1, found.pointers());
  CHECK(deepest.size() == 0);
  CHECK(deepest.unlisted(1).empty());
}

}  // namespace
}  // namespace ringfence::nodes
