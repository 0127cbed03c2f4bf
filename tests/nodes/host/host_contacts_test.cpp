#include "nodes/host/host_contacts.hpp"

#include <array>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "base/pair_sort.hpp"
#include "nodes/host/host_records.hpp"

namespace ringfence::nodes {
namespace {

using Keys = std::vector<std::pair<ObjectNumber, ObjectNumber>>;

Contact contact_of(ObjectNumber a, ObjectNumber b, Phase phase = Phase::persist) {
  Contact contact;
  contact.a = a;
  contact.b = b;
  contact.phase = phase;
  return contact;
}

/// The contacts of a hosted object as a move reads them.
Keys keys_of(const HostContacts& contacts, const HostedObjects& objects, ObjectNumber number) {
  Keys keys;
  for (const std::uint32_t at : contacts.of(objects.find(number))) {
    keys.emplace_back(contacts.list()[at].a, contacts.list()[at].b);
  }
  return keys;
}

struct ThreeObjects {
  ThreeObjects() {
    for (const ObjectNumber number : {2u, 4u, 6u}) objects.adopt(record_of(number), nullptr);
  }
  HostedObjects objects{4, 0};
  HostContacts contacts{4};
};

TEST_CASE("a move reads own and received contacts of the frame before by object, without those that ended") {
  ThreeObjects host;
  host.contacts.begin(1);
  host.contacts.add_own(1) = contact_of(4, 6);
  host.contacts.add_own(1) = contact_of(2, 9);
  host.contacts.order_own(1, base::PairSort::key(2, 9), 1);
  host.contacts.order_own(1, base::PairSort::key(4, 6), 0);
  host.contacts.add(1, contact_of(1, 4));
  host.contacts.add(1, contact_of(2, 3, Phase::end));
  host.contacts.add(1, contact_of(2, 4));
  host.contacts.begin(2);
  host.contacts.begin_move(2, host.objects);
  CHECK(keys_of(host.contacts, host.objects, 2) == Keys{{2, 4}, {2, 9}});
  CHECK(keys_of(host.contacts, host.objects, 4) == Keys{{1, 4}, {2, 4}, {4, 6}});
  CHECK(keys_of(host.contacts, host.objects, 6) == Keys{{4, 6}});
  CHECK(host.contacts.received(1).size() == 3);
  CHECK(host.contacts.received(2).empty());
}

TEST_CASE("an own contact persists until it is confirmed that it begins") {
  ThreeObjects host;
  host.contacts.begin(1);
  CHECK(host.contacts.add_own(1).phase == Phase::persist);
  host.contacts.add_own(1) = contact_of(2, 4);
  host.contacts.confirm_begin(1, 1);
  host.contacts.order_own(1, base::PairSort::key(2, 4), 1);
  host.contacts.order_own(1, base::PairSort::key(2, 4), 0);
  host.contacts.begin_move(2, host.objects);
  CHECK(host.contacts.list()[0].phase == Phase::persist);
  CHECK(host.contacts.list()[1].phase == Phase::begin);
}

TEST_CASE("a move reads no own contact that is unlisted, and all received ones, with late contacts or without") {
  for (const bool with_late : {false, true}) {
    CAPTURE(with_late);
    ThreeObjects host;
    host.contacts.begin(1);
    for (const auto& [a, b] : Keys{{4, 6}, {2, 9}, {2, 4}}) host.contacts.add_own(1) = contact_of(a, b);
    const std::array<std::uint64_t, 3> keys{base::PairSort::key(2, 4), base::PairSort::key(2, 9),
                                            base::PairSort::key(4, 6)};
    for (std::uint32_t i = 0; i < 3; ++i) host.contacts.order_own(1, keys[i], 2 - i);
    host.contacts.unlist_own(1, std::array{keys[0], keys[2]});
    host.contacts.add(1, contact_of(1, 4));
    host.contacts.add(1, contact_of(2, 3, Phase::end));
    host.contacts.add(1, contact_of(4, 8));
    if (with_late) host.contacts.add_late(contact_of(6, 7));
    host.contacts.begin(2);
    host.contacts.begin_move(2, host.objects);
    CHECK(keys_of(host.contacts, host.objects, 2) == Keys{{2, 4}});
    CHECK(keys_of(host.contacts, host.objects, 4) == Keys{{1, 4}, {2, 4}, {4, 6}, {4, 8}});
    CHECK(keys_of(host.contacts, host.objects, 6) == (with_late ? Keys{{4, 6}, {6, 7}} : Keys{{4, 6}}));
    CHECK(host.contacts.received(1).size() == 3);
  }
}

TEST_CASE("late contacts join those of the frame, each once, until the move ends") {
  ThreeObjects host;
  host.contacts.begin(1);
  host.contacts.add(1, contact_of(2, 6));
  for (const auto& late : {contact_of(4, 6), contact_of(1, 6), contact_of(2, 6), contact_of(4, 6)}) {
    host.contacts.add_late(late);
  }
  host.contacts.begin_move(2, host.objects);
  CHECK(keys_of(host.contacts, host.objects, 6) == Keys{{1, 6}, {2, 6}, {4, 6}});
  host.contacts.end_move(2);
  host.contacts.begin_move(2, host.objects);
  CHECK(keys_of(host.contacts, host.objects, 6) == Keys{{2, 6}});
}

TEST_CASE(
    "with one frame kept, contacts are read until the move is done, and those of a repeated frame replace each other") {
  ThreeObjects host;
  host.contacts.keep_one_frame();
  host.contacts.begin(1);
  host.contacts.end_move(1);
  host.contacts.add(1, contact_of(2, 6));
  host.contacts.begin(2);  // before the move of frame 2 it removes nothing
  host.contacts.begin_move(2, host.objects);
  CHECK(keys_of(host.contacts, host.objects, 2) == Keys{{2, 6}});
  host.contacts.end_move(2);
  host.contacts.add(2, contact_of(2, 4));
  host.contacts.begin(2);  // detected again
  host.contacts.add(2, contact_of(4, 6));
  host.contacts.begin(3);
  host.contacts.begin_move(3, host.objects);
  CHECK(keys_of(host.contacts, host.objects, 2).empty());
  CHECK(keys_of(host.contacts, host.objects, 4) == Keys{{4, 6}});
}

TEST_CASE("given lists replace the contacts of one move") {
  ThreeObjects host;
  host.contacts.begin(1);
  host.contacts.add(1, contact_of(2, 6));
  const std::array<Contact, 1> given{contact_of(2, 4)};
  const std::array<std::uint64_t, 1> keys{base::PairSort::key(2, 4)};
  host.contacts.read(given, keys);
  host.contacts.begin_move(2, host.objects);
  CHECK(keys_of(host.contacts, host.objects, 2) == Keys{{2, 4}});
  host.contacts.end_move(2);
  host.contacts.begin_move(2, host.objects);
  CHECK(keys_of(host.contacts, host.objects, 2) == Keys{{2, 6}});
}

}  // namespace
}  // namespace ringfence::nodes
