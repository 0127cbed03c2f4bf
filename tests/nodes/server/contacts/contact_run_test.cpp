#include "nodes/server/contacts/contact_run.hpp"

#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/server/contacts/ledger_node.hpp"

namespace ringfence::nodes {
namespace {

using namespace ledger_test;

/// A run of the frame, and objects whose numbers are slot + 1.
struct Runs {
  Runs() { run.begin(7); }

  bool add(std::uint32_t slot_a, std::uint32_t slot_b) {
    messages::CollisionRecord record;
    record.slot_a = slot_a;
    record.slot_b = slot_b;
    record.depth = static_cast<float>(slot_b);
    return run.add(record, objects);
  }
  bool add_beginning(std::uint64_t key, std::uint32_t position, std::uint32_t flags = 0) {
    return run.add(messages::ChangeRecord{key, position, flags}, keys_before);
  }
  bool add_ending(std::uint64_t key, std::uint32_t flags = 0) {
    return run.add(messages::ChangeRecord{key, 0, messages::change_ended | flags}, keys_before);
  }

  const std::vector<ObjectRow> rows = rows_of(7, false);
  const std::vector<ObjectOrigin> origins = origins_of(rows);
  const ContactColumns columns{rows};
  const ContactObjects objects{rows, origins, columns.numbers, columns.marks};
  /// The contacts of the frame before: (1, 4), (2, 3), (2, 12), (5, 6). Slots 0 and 11 are avatars.
  const std::vector<std::uint64_t> keys_before{word_of({1, 4}), word_of({2, 3}), word_of({2, 12}), word_of({5, 6})};
  const std::vector<Found> found_before{{0, 3, 0}, {1, 2, 0}, {1, 11, 0}, {4, 5, 0}};
  ContactRun run;
};

template <class List>
std::vector<std::uint64_t> keys_of(const List& list) {
  std::vector<std::uint64_t> keys;
  for (const auto& entry : list) keys.push_back(entry.key);
  return keys;
}

TEST_CASE("contacts are added in the order of their objects, and others are refused") {
  Runs test;
  CHECK(test.add(1, 2));
  CHECK(!test.add(0, 5));      // before the last one
  CHECK(!test.add(4, 3));      // a above b
  CHECK(!test.add(4, 4));      // an object with itself
  CHECK(!test.add(3, slots));  // no such slot
  CHECK(!test.add(~0u, ~0u));
  CHECK(test.add(1, 2));  // the same again: duplicates are dropped later
  CHECK(test.add(1, 11));
  CHECK(test.run.received() == 3);

  test.run.end(test.objects, test.found_before);
  CHECK(test.run.is_complete());
  const NodeContacts& received = test.run.node_contacts();
  CHECK(std::vector(received.keys.begin(), received.keys.end()) ==
        std::vector{word_of({2, 3}), word_of({2, 3}), word_of({2, 12})});
  CHECK(received.touches[received.found[2].touch].depth == 11);
  CHECK(keys_of(received.user_contacts) == std::vector{word_of({2, 12})});
}

TEST_CASE("a change names a contact that was added, or one of the frame before, in order") {
  Runs test;
  for (const std::uint32_t other : {5u, 6u, 7u}) REQUIRE(test.add(4, other));
  CHECK(!test.add_beginning(word_of({5, 6}), 1));  // another contact is there
  CHECK(!test.add_beginning(word_of({5, 8}), 3));  // no contact is there
  CHECK(test.add_beginning(word_of({5, 7}), 1, messages::change_at_border));
  CHECK(!test.add_beginning(word_of({5, 7}), 1));  // again
  CHECK(!test.add_beginning(word_of({5, 6}), 0));  // before the last one
  CHECK(test.add_beginning(word_of({5, 8}), 2));

  CHECK(!test.add_ending(word_of({1, 5})));  // not in the frame before
  CHECK(test.add_ending(word_of({1, 4})));
  CHECK(test.add_ending(word_of({2, 12}), messages::change_at_border));
  CHECK(!test.add_ending(word_of({2, 3})));  // before the last one
  CHECK(!test.add_ending(word_of({9, 9})));  // above all keys
  CHECK(test.add_ending(word_of({5, 6})));

  test.run.end(test.objects, test.found_before);
  const ContactSummary& summary = test.run.node_contacts().summary;
  CHECK(summary.contacts == 3);
  CHECK(summary.began == 2);
  CHECK(std::vector(summary.begun, summary.begun + 3) == std::vector<std::uint8_t>{0, 1, 1});
  CHECK(keys_of(summary.border_beginning) == std::vector{word_of({5, 7})});
  CHECK(std::vector(summary.ending.begin(), summary.ending.end()) ==
        std::vector{word_of({1, 4}), word_of({2, 12}), word_of({5, 6})});
  CHECK(std::vector(summary.border_ending.begin(), summary.border_ending.end()) == std::vector{word_of({2, 12})});
  CHECK(keys_of(test.run.node_contacts().user_contacts_ending) == std::vector{word_of({1, 4}), word_of({2, 12})});
}

TEST_CASE("a run is empty after begin(), and that of a node that shares its contacts is the node's") {
  Runs test;
  test.run.join(7);
  REQUIRE(test.add(1, 2));
  REQUIRE(test.add_ending(word_of({1, 4})));
  test.run.end(test.objects, test.found_before);
  test.run.correct(0);
  test.run.unlist(std::vector<std::uint32_t>{0});
  CHECK(test.run.unlisted().size() == 1);
  CHECK(!test.run.continues(7));

  test.run.begin(8);
  CHECK(!test.run.is_complete());
  CHECK(test.run.received() == 0);
  CHECK(test.run.corrections().empty());
  NodeContacts shared;
  test.run.share(shared);
  CHECK(test.run.continues(8));
  CHECK(test.run.shared() == &shared);
  CHECK(&test.run.node_contacts() == &shared);

  test.run.begin(9);
  CHECK(test.run.shared() == nullptr);
  CHECK(test.run.node_contacts().keys.empty());
}

}  // namespace
}  // namespace ringfence::nodes
