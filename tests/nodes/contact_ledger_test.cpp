#include "nodes/contact_ledger.hpp"

#include <algorithm>
#include <cstring>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/contact_order.hpp"

namespace ringfence::nodes {
namespace {

using Key = std::pair<ObjectNumber, ObjectNumber>;

constexpr std::uint32_t slots = 97;

std::uint64_t word_of(const Key& key) { return ContactOrder::key(key.first, key.second); }

messages::CollisionRecord record_of(const Key& key, float depth) {
  messages::CollisionRecord record;
  record.slot_a = key.first % slots;
  record.slot_b = key.second % slots;
  record.depth = depth;
  record.normal = {depth, 1, 2};
  record.point = {double{depth}, 3, 4};
  return record;
}

/// Rows of which each stands somewhere else, and elsewhere in each frame.
std::vector<ObjectRow> rows_of(std::uint64_t frame) {
  std::vector<ObjectRow> rows(slots);
  for (std::uint32_t slot = 0; slot < slots; ++slot) {
    rows[slot].pose.position = {static_cast<double>(slot), static_cast<double>(frame), 0};
  }
  return rows;
}

TEST_CASE("the ledger begins, continues and ends contacts as a map of the two frames does") {
  for (const std::size_t nodes : {1u, 2u, 3u, 16u}) {
    const auto seed = static_cast<unsigned>(100 + nodes);
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    ContactLedger ledger(nodes, 16);
    std::map<Key, float> before;
    for (std::uint64_t frame = 0; frame < 200; ++frame) {
      CAPTURE(frame);
      std::map<Key, float> now;
      const std::uint64_t many = frame % 7 == 0 ? 0 : random() % 120;
      const std::uint64_t numbers = frame % 5 == 0 ? 0xfffffff0u : 25;
      for (std::uint64_t i = 0; i < many; ++i) {
        auto a = static_cast<ObjectNumber>(1 + random() % numbers);
        auto b = static_cast<ObjectNumber>(1 + random() % numbers);
        if (a != b) {
          now[{std::min(a, b), std::max(a, b)}] = static_cast<float>(random() % 1000);
        }
      }
      if (frame % 3 != 0) {
        for (const auto& [key, depth] : before) {
          if (random() % 2 == 0) {
            now[key] = depth + 1;
          }
        }
      }
      ledger.begin(frame);
      // Dealt to the nodes at random, in the order of the keys at each.
      std::vector<std::size_t> received(nodes, 0);
      std::vector<std::vector<bool>> runs(nodes);  // whether each contact of a node's run persists
      std::vector<NodeNumber> finders;
      for (const auto& [key, depth] : now) {
        const auto node = static_cast<NodeNumber>(random() % nodes);
        ledger.receive(node, word_of(key), record_of(key, depth));
        ++received[node];
        finders.push_back(node);
        runs[node].push_back(before.count(key) != 0);
      }
      for (NodeNumber node = 0; node < nodes; ++node) {
        REQUIRE(ledger.received(node) == received[node]);
      }
      REQUIRE(ledger.merge() == 0);
      ledger.write(rows_of(frame), true);
      for (NodeNumber node = 0; node < nodes; ++node) {
        const auto persists = ledger.persists(node);
        REQUIRE(persists.size() == (runs[node].size() + 63) / 64);
        for (std::size_t i = 0; i < runs[node].size(); ++i) {
          REQUIRE((persists[i / 64] >> (i % 64) & 1) == (runs[node][i] ? 1u : 0u));
        }
      }

      const auto contacts = ledger.contacts(frame);
      const auto found = ledger.found(frame);
      const auto keys = ledger.keys(frame);
      REQUIRE(contacts.size() == now.size());
      REQUIRE(found.size() == now.size());
      REQUIRE(keys.size() == now.size());
      std::size_t i = 0;
      std::size_t began = 0;
      for (const auto& [key, depth] : now) {
        const bool persists = before.count(key) != 0;
        began += persists ? 0 : 1;
        REQUIRE((Key{contacts[i].a, contacts[i].b} == key));
        REQUIRE(contacts[i].depth == depth);
        REQUIRE(contacts[i].phase == (persists ? Phase::persist : Phase::begin));
        REQUIRE(contacts[i].normal.x == depth);
        REQUIRE(contacts[i].point.x == double{depth});
        REQUIRE(contacts[i].pose_a.position.x == key.first % slots);
        REQUIRE(contacts[i].pose_b.position.x == key.second % slots);
        REQUIRE(contacts[i].pose_b.position.y == static_cast<double>(frame));
        REQUIRE(keys[i] == word_of(key));
        REQUIRE(found[i].a == key.first % slots);
        REQUIRE(found[i].b == key.second % slots);
        REQUIRE(found[i].by == finders[i]);
        ++i;
      }
      REQUIRE(ledger.began() == began);
      const auto ended = ledger.ended(frame);
      const auto ended_found = ledger.ended_found(frame);
      std::size_t e = 0;
      for (const auto& [key, depth] : before) {
        if (now.count(key) != 0) {
          continue;
        }
        REQUIRE(e < ended.size());
        REQUIRE((Key{ended[e].a, ended[e].b} == key));
        REQUIRE(ended[e].phase == Phase::end);
        REQUIRE(ended[e].depth == depth);  // the geometry of the last contact
        REQUIRE(ended[e].pose_a.position.y == static_cast<double>(frame - 1));
        REQUIRE(ledger.ended_keys(frame)[e] == word_of(key));
        REQUIRE(ended_found[e].a == key.first % slots);
        ++e;
      }
      REQUIRE(e == ended.size());
      REQUIRE(ended_found.size() == e);
      // The frame before stays readable while this one was made.
      if (frame > 0) {
        REQUIRE(ledger.contacts(frame - 1).size() == before.size());
      }
      before = now;
    }
  }
}

/// A node that shares what it finds: its contacts in an order of its own, some of which others have to be told.
struct Sharing {
  Findings findings;
  std::vector<Contact> contacts;

  void find(const std::vector<Contact>& sorted, std::mt19937_64& random) {
    contacts = sorted;
    std::shuffle(contacts.begin(), contacts.end(), random);
    findings.contacts = contacts.data();
    findings.keys.clear();
    findings.found.clear();
    findings.outer.clear();
    for (const Contact& contact : sorted) {
      const auto same = [&](const Contact& other) { return other.a == contact.a && other.b == contact.b; };
      const auto at = std::find_if(contacts.begin(), contacts.end(), same) - contacts.begin();
      if (random() % 3 == 0) {
        findings.outer.push_back(static_cast<std::uint32_t>(findings.keys.size()));
      }
      findings.keys.push_back(word_of({contact.a, contact.b}));
      findings.found.push_back({contact.a % slots, contact.b % slots, static_cast<std::uint32_t>(at)});
    }
  }
};

TEST_CASE("what nodes share and write themselves makes the list that the server would have written, also when lost") {
  for (const unsigned seed : {11u, 12u, 13u, 14u}) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    constexpr NodeNumber nodes = 5;
    ContactLedger ledger(nodes, 16), plain(1, 16);
    std::vector<Sharing> sharing(nodes);
    for (std::uint64_t frame = 0; frame < 120; ++frame) {
      CAPTURE(frame);
      ledger.begin(frame);
      plain.begin(frame);
      std::vector<std::vector<Contact>> shares(nodes);
      std::map<Key, Contact> now;
      for (std::uint64_t i = random() % 200; i > 0; --i) {
        const auto a = static_cast<ObjectNumber>(1 + random() % 20), b = static_cast<ObjectNumber>(21 + random() % 20);
        Contact contact;
        contact.a = a;
        contact.b = b;
        contact.depth = static_cast<float>(random() % 1000);
        contact.point = {1.0 * a, 2.0 * b, 3};
        contact.phase = Phase::end;  // not the node's to say
        contact.pose_a = rows_of(frame)[a % slots].pose;
        contact.pose_b = rows_of(frame)[b % slots].pose;
        now[{a, b}] = contact;
      }
      for (const auto& [key, contact] : now) {
        messages::CollisionRecord record = record_of(key, contact.depth);
        record.normal = contact.normal;
        record.point = contact.point;
        plain.receive(0, word_of(key), record);
        shares[random() % nodes].push_back(contact);
      }
      REQUIRE(plain.merge() == 0);
      plain.write(rows_of(frame), true);
      for (NodeNumber node = 0; node < nodes; ++node) {
        sharing[node].find(shares[node], random);
        ledger.receive(node, sharing[node].findings);
        REQUIRE(ledger.received(node) == shares[node].size());
      }
      REQUIRE(ledger.merge() == 0);
      const bool all = frame % 4 == 0;
      ledger.write(rows_of(frame), all);
      // Some are lost before they have written, or after; what a late one writes later hurts nobody.
      std::vector<NodeNumber> lost;
      for (NodeNumber node = 0; node < nodes; ++node) {
        if (frame % 3 == 0 && random() % 2 == 0) {
          lost.push_back(node);
        } else {
          sharing[node].findings.write_rest(node, [](std::uint32_t) {});
        }
      }
      if (!lost.empty()) {
        ledger.take_over(lost);
      }
      for (const NodeNumber node : lost) {
        std::fill(sharing[node].contacts.begin(), sharing[node].contacts.end(), Contact{});
        sharing[node].findings.write_rest(node, [](std::uint32_t) {});
      }
      const auto contacts = ledger.contacts(frame), expected = plain.contacts(frame);
      REQUIRE(contacts.size() == expected.size());
      for (std::size_t i = 0; i < contacts.size(); ++i) {
        REQUIRE(std::memcmp(&contacts[i], &expected[i], sizeof(Contact)) == 0);
        REQUIRE(ledger.found(frame)[i].a == plain.found(frame)[i].a);
        REQUIRE(ledger.found(frame)[i].b == plain.found(frame)[i].b);
      }
      const auto ended = ledger.ended(frame), expected_ended = plain.ended(frame);
      REQUIRE(ended.size() == expected_ended.size());
      REQUIRE((ended.empty() || std::memcmp(ended.data(), expected_ended.data(), ended.size_bytes()) == 0));
      ledger.forget_lost();
    }
  }
}

TEST_CASE("a pair that two nodes found is kept once and counted") {
  constexpr unsigned seed = 3;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  for (int round = 0; round < 200; ++round) {
    CAPTURE(round);
    ContactLedger ledger(4, 8);
    ledger.begin(0);
    std::map<Key, int> found;
    for (ObjectNumber a = 1; a <= 12; ++a) {
      for (NodeNumber node = 0; node < 4; ++node) {
        if (random() % 3 == 0) {
          ledger.receive(node, word_of({a, a + 1}), record_of({a, a + 1}, 1));
          ++found[{a, a + 1}];
        }
      }
    }
    std::uint64_t surplus = 0;
    for (const auto& [key, times] : found) {
      surplus += static_cast<std::uint64_t>(times - 1);
    }
    CHECK(ledger.merge() == surplus);
    ledger.write(rows_of(0), true);
    CHECK(ledger.contacts(0).size() == found.size());
  }
}

TEST_CASE("contacts are put in the order of (a, b), whatever their numbers") {
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u, 6u}) {
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    ContactOrder order;
    for (const std::size_t size : {0u, 1u, 2u, 63u, 64u, 65u, 66u, 500u, 5000u}) {
      CAPTURE(size);
      order.clear();
      std::vector<std::pair<Key, std::uint32_t>> model;
      // Of 10^7 the two numbers and a position fit a word up to 50,000 contacts, of 2^32 never.
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
        REQUIRE(order.key_at(i) == word_of(model[i].first));
        // Equal keys may stand in any order; real contacts have none.
        const auto original = std::find_if(model.begin(), model.end(), [&](const auto& m) { return m.second == at; });
        if (size <= 500) {
          REQUIRE(original->first == model[i].first);
        } else if (i > 0 && range > 4000) {
          REQUIRE(model[i].second == at);  // no two keys are equal here
        }
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes
