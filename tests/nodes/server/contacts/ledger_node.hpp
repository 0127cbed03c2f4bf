#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "base/pair_sort.hpp"
#include "nodes/server/contacts/contact_ledger.hpp"

namespace ringfence::nodes::ledger_test {

using Key = std::pair<ObjectNumber, ObjectNumber>;

inline constexpr std::uint32_t slots = 40;

inline std::uint64_t word_of(const Key& key) { return base::PairSort::key(key.first, key.second); }

inline Key key_of(std::uint64_t word) {
  return {static_cast<ObjectNumber>(word >> 32), static_cast<ObjectNumber>(word)};
}

/// Whether a slot has an avatar, so that its contacts concern a user node.
inline bool is_avatar(std::uint32_t slot) { return slot % 11 == 0; }

/// The rows of a frame. Each slot has its own position, which is different in each frame. Numbers ascend by slot.
inline std::vector<ObjectRow> rows_of(std::uint64_t frame, bool large_numbers) {
  std::vector<ObjectRow> rows(slots);
  for (std::uint32_t slot = 0; slot < slots; ++slot) {
    rows[slot].object.number = large_numbers ? 0xfffffff0u - 97'000'001u * (slots - slot) : slot + 1;
    rows[slot].object.generation = 3 * slot + 1;
    rows[slot].layer = static_cast<std::uint16_t>(slot % 32);
    rows[slot].category = static_cast<std::uint16_t>(is_avatar(slot) ? Category::avatar : Category::active);
    rows[slot].pose.position = {static_cast<double>(slot), static_cast<double>(frame), 0};
  }
  return rows;
}

/// ContactObjects::numbers and marks of these rows.
struct ContactColumns {
  explicit ContactColumns(const std::vector<ObjectRow>& rows) {
    for (const ObjectRow& row : rows) {
      numbers.push_back(row.object.number);
      const bool is_avatar = row.category == static_cast<std::uint16_t>(Category::avatar);
      marks.push_back(static_cast<ObjectMarks>(alive_mark | (is_avatar ? avatar_mark : 0)));
    }
  }
  std::vector<ObjectNumber> numbers;
  std::vector<ObjectMarks> marks;
};

inline std::vector<ObjectOrigin> origins_of(const std::vector<ObjectRow>& rows) {
  std::vector<ObjectOrigin> origins(rows.size());
  for (std::size_t slot = 0; slot < rows.size(); ++slot) origins[slot].user_data = ~std::uint64_t{slot};
  return origins;
}

/// An expected contact of a frame; its phase is computed by the test.
struct ExpectedContact {
  Contact contact;
  std::uint32_t slot_a = 0, slot_b = 0;
  std::size_t finder = 0;  ///< number of the node that owns the pair in the frame
};
using ExpectedContacts = std::map<Key, ExpectedContact>;

/// A CD node as the ledger sees it.
struct Node {
  std::unique_ptr<NodeContacts> lists = std::make_unique<NodeContacts>();
  bool shares = false;                             ///< the ledger reads `lists`; otherwise the node sends messages
  bool joined = false;                             ///< the ledger knows the node
  bool free = false;                               ///< the slot has no node
  std::vector<narrow_phase::PairContact> touches;  ///< in the order of detection
  std::vector<narrow_phase::Body> bodies;          ///< of all slots, in random order
  OutputMergeScratch scratch;

  /// The node finds the contacts `own`. `before` and `now` are the contacts of all nodes in the two frames.
  void find(std::uint64_t frame, const std::vector<const ExpectedContact*>& own, const std::vector<ObjectRow>& rows,
            const ExpectedContacts& before, const ExpectedContacts& now, std::mt19937_64& random) {
    std::vector<std::uint32_t> places = shuffled(own.size(), random);
    const std::vector<std::uint32_t> body_of = shuffled(rows.size(), random);
    bodies.resize(rows.size());
    for (std::size_t slot = 0; slot < rows.size(); ++slot) {
      bodies[body_of[slot]] = {rows[slot].pose,
                               0,
                               rows[slot].object.number,
                               rows[slot].object.generation,
                               rows[slot].layer,
                               rows[slot].category,
                               origins_of(rows)[slot].user_data};
    }
    touches.resize(own.size());
    lists->start(frame);
    lists->report.duplicates = 0;
    for (std::uint32_t i = 0; i < own.size(); ++i) {
      const Contact& contact = own[i]->contact;
      const Vec3d& origin = rows[own[i]->slot_a].pose.position;
      const auto part = [](double point, double from) { return static_cast<float>(point - from); };
      touches[places[i]] = {
          0,
          contact.depth,
          contact.normal,
          {part(contact.point.x, origin.x), part(contact.point.y, origin.y), part(contact.point.z, origin.z)}};
      lists->keys.push_back(word_of({contact.a, contact.b}));
      lists->found.push_back(
          {own[i]->slot_a, own[i]->slot_b, body_of[own[i]->slot_a], body_of[own[i]->slot_b], places[i]});
      if (is_avatar(own[i]->slot_a) || is_avatar(own[i]->slot_b)) {
        lists->user_contacts.push_back({lists->keys[i], i, lists->found[i]});
      }
    }
    lists->touches = touches.data();
    lists->bodies = bodies.data();
    // If the pair is in contact in the other frame, another node may have found it there. If not, the node knows in
    // most cases that no other node found it.
    const auto is_alone = [&](const ExpectedContacts& others, std::uint64_t key) {
      return others.count(key_of(key)) == 0 && random() % 4 != 0;
    };
    lists->compare([&](const FoundContact& one) { return is_alone(before, lists->keys[at_of(one)]); },
                   [&](std::uint64_t key, const FoundContact& one) {
                     REQUIRE(rows[one.slot_a].object.number == key_of(key).first);
                     REQUIRE(rows[one.slot_b].object.number == key_of(key).second);
                     return is_alone(now, key);
                   });
  }
  void write() {
    if (!lists->output_merge->server_writes) {
      lists->report.duplicates = write_slice(*lists->output_merge, lists->share, scratch);
    }
    lists->gate.leave();
  }

 private:
  std::size_t at_of(const FoundContact& one) const { return static_cast<std::size_t>(&one - lists->found.data()); }
  static std::vector<std::uint32_t> shuffled(std::size_t count, std::mt19937_64& random) {
    std::vector<std::uint32_t> places(count);
    for (std::uint32_t i = 0; i < count; ++i) places[i] = i;
    std::shuffle(places.begin(), places.end(), random);
    return places;
  }
};

}  // namespace ringfence::nodes::ledger_test
