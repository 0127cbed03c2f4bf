#include "nodes/exchange/node_contacts.hpp"

#include <algorithm>
#include <random>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/exchange/node_contact_order.hpp"

namespace ringfence::nodes {
namespace {

constexpr NodeNumber nodes = 3;

template <class T>
std::vector<T> copy(const base::FlatList<T>& list) {
  return {list.begin(), list.end()};
}

/// Properties of a contact that follow from its key, so that both lists of a test agree on them.
bool concerns_user(std::uint64_t key) { return key % 3 == 0; }
bool concerns_peer(std::uint64_t key, NodeNumber peer) { return key % 5 <= peer; }
bool is_at_border(std::uint64_t key) { return key % 4 == 1; }

/// Lists these contacts of a frame, as a node does. `alone`: keys that certainly end at this node.
void list(NodeContacts& contacts, std::uint64_t frame, const std::set<std::uint64_t>& keys,
          const std::set<std::uint64_t>& alone = {}) {
  contacts.start(frame);
  for (const std::uint64_t key : keys) {
    const auto position = static_cast<std::uint32_t>(contacts.keys.size());
    contacts.keys.push_back(key);
    contacts.found.push_back({static_cast<std::uint32_t>(key), 0, 0, 0, position});
    if (concerns_user(key)) contacts.user_contacts.push_back({key, position, contacts.found[position]});
    for (NodeNumber peer = 0; peer < nodes; ++peer) {
      if (concerns_peer(key, peer)) contacts.for_peers.add(peer, position);
    }
  }
  contacts.compare([](const FoundContact& found) { return !is_at_border(found.slot_a); },
                   [&](std::uint64_t key, const FoundContact&) { return alone.count(key) != 0 || !is_at_border(key); });
  contacts.for_peers.finish(nodes);
}

std::set<std::uint64_t> random_keys(std::mt19937_64& random) {
  std::set<std::uint64_t> keys;
  for (std::uint64_t i = random() % 60; i > 0; --i) keys.insert(1 + random() % 80);
  return keys;
}

/// The summary says what the lists say, whether it refers to them or to copies.
void require_summary(const NodeContacts& contacts) {
  const ContactSummary& summary = contacts.summary;
  REQUIRE(summary.contacts == contacts.keys.size());
  REQUIRE(summary.began == contacts.beginning.size());
  REQUIRE(summary.begun == contacts.begun.data());
  const auto same_keys = [](std::span<const std::uint64_t> got, std::span<const std::uint64_t> expected) {
    return std::equal(got.begin(), got.end(), expected.begin(), expected.end());
  };
  REQUIRE(same_keys(summary.ending, contacts.ending.span()));
  REQUIRE(same_keys(summary.border_ending, contacts.border_ending.span()));
  REQUIRE(summary.border_beginning.size() == contacts.border_beginning.size());
  for (std::size_t i = 0; i < summary.border_beginning.size(); ++i) {
    REQUIRE(summary.border_beginning[i].key == contacts.border_beginning[i].key);
    REQUIRE(summary.border_beginning[i].position == contacts.border_beginning[i].position);
  }
}

void require_same(const NodeContacts& got, const NodeContacts& expected) {
  require_summary(got);
  REQUIRE(copy(got.keys) == copy(expected.keys));
  REQUIRE(copy(got.begun) == copy(expected.begun));
  REQUIRE(copy(got.beginning) == copy(expected.beginning));
  REQUIRE(copy(got.ending) == copy(expected.ending));
  REQUIRE(copy(got.border_ending) == copy(expected.border_ending));
  REQUIRE(got.border_beginning.size() == expected.border_beginning.size());
  for (std::size_t i = 0; i < got.border_beginning.size(); ++i) {
    REQUIRE(got.border_beginning[i].key == expected.border_beginning[i].key);
    REQUIRE(got.border_beginning[i].position == expected.border_beginning[i].position);
  }
  REQUIRE(got.found.size() == expected.found.size());
  for (std::size_t i = 0; i < got.found.size(); ++i) REQUIRE(got.found[i].slot_a == expected.found[i].slot_a);
  REQUIRE(got.user_contacts.size() == expected.user_contacts.size());
  for (std::size_t i = 0; i < got.user_contacts.size(); ++i) {
    REQUIRE(got.user_contacts[i].key == expected.user_contacts[i].key);
    REQUIRE(got.user_contacts[i].position == expected.user_contacts[i].position);
  }
  std::set<std::uint64_t> got_ending, expected_ending;
  for (const UserContact& contact : got.user_contacts_ending) got_ending.insert(contact.key);
  for (const UserContact& contact : expected.user_contacts_ending) expected_ending.insert(contact.key);
  REQUIRE(got_ending == expected_ending);
  for (NodeNumber peer = 0; peer < nodes; ++peer) {
    const auto one = got.for_peers.of(peer), other = expected.for_peers.of(peer);
    REQUIRE(std::vector(one.begin(), one.end()) == std::vector(other.begin(), other.end()));
  }
}

TEST_CASE("after contacts are unlisted a node's lists are those of a node that did not find them, frame after frame") {
  for (unsigned seed = 0; seed < 40; ++seed) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    NodeContacts contacts, expected;
    std::size_t unlisted = 0;
    for (std::uint64_t frame = 0; frame < 30; ++frame) {
      CAPTURE(frame);
      const std::set<std::uint64_t> found = random_keys(random);
      const unsigned share = static_cast<unsigned>(random() % 5);  // 0: none; 4: all
      std::set<std::uint64_t> listed, others;
      for (const std::uint64_t key : found) (random() % 4 < share ? others : listed).insert(key);
      list(contacts, frame, found);
      std::vector<std::uint32_t> positions;
      for (std::uint32_t i = 0; i < contacts.keys.size(); ++i) {
        if (others.count(contacts.keys[i]) != 0) positions.push_back(i);
      }
      contacts.unlist(positions);
      list(expected, frame, listed, others);
      require_same(contacts, expected);
      unlisted += positions.size();
    }
    REQUIRE(unlisted > 100);
  }
}

TEST_CASE("contacts of any number of nodes are put in order, equal keys in the order of the nodes") {
  std::mt19937_64 random(8);
  NodeContactOrder order;
  for (int round = 0; round < 300; ++round) {
    CAPTURE(round);
    struct Entry {
      std::uint64_t key;
      NodeNumber node;
      std::uint32_t position;
      bool operator<(const Entry& other) const { return key < other.key; }
    };
    std::vector<Entry> expected;
    order.start({});
    const std::uint64_t numbers = 1 + random() % 40;
    const std::uint64_t lists = random() % 6;
    for (NodeNumber node = 0; node < lists; ++node) {
      std::set<std::uint64_t> keys;
      for (std::size_t i = random() % 200; i > 0; --i) {
        keys.insert(base::PairSort::key(static_cast<ObjectNumber>(1 + random() % numbers),
                                        static_cast<ObjectNumber>(1 + random() % numbers)));
      }
      std::uint32_t position = 0;
      for (const std::uint64_t key : keys) expected.push_back({key, node, position++});
      // In pieces: a node that adds the end of its list in a call of its own has one list all the same.
      const std::vector<std::uint64_t> list(keys.begin(), keys.end());
      const auto first = static_cast<std::uint32_t>(random() % (list.size() + 1));
      order.add_list(node, 0, std::span(list).first(first));
      order.add_list(node, first, std::span(list).subspan(first));
    }
    order.sort();
    std::stable_sort(expected.begin(), expected.end());
    REQUIRE(order.size() == expected.size());
    std::size_t different = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      different += order.key(i) != expected[i].key || order.node(i) != expected[i].node ||
                   order.position(i) != expected[i].position;
    }
    CHECK(different == 0);
  }
}

}  // namespace
}  // namespace ringfence::nodes
