#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/pair_sort.hpp"
#include "nodes/exchange/node_contact_order.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "ringfence/contact.hpp"

namespace ringfence::nodes {

/// A contact that the server reports to the hosts of its objects, and the place where the contact is stored.
struct ContactNotice {
  std::uint64_t key = 0;                        ///< base::PairSort::key of the pair
  const NodeContacts* node_contacts = nullptr;  ///< source of the contact; null if it ended
  const Contact* ended = nullptr;               ///< if it ended: the contact of the frame before; otherwise null
  FoundContact place;                           ///< its entry in NodeContacts::found; unused if it ended
  Found found;
  Phase phase = Phase::begin;

  /// Writes the contact, with its phase, to `to`.
  void write(Contact& to) const noexcept {
    if (node_contacts != nullptr) {
      node_contacts->write(place, phase, to);
    } else {
      NodeContacts::copy(*ended, phase, to);
    }
  }
};

/// Lists contacts as notices, in order of (a, b). Threads: one. Memory: grows to the longest list.
///
/// A node is the index of its contacts in `node_contacts`. What a function returns is valid until the next call for
/// contacts of the same kind: listed or ended.
class ContactNotices {
 public:
  /// Reserves memory for lists of `contacts` contacts.
  void reserve(std::size_t contacts);

  /// All contacts of the nodes, each pair once.
  std::span<const ContactNotice> list_all(std::span<NodeContacts* const> node_contacts);
  /// Those of avatars, which are few.
  std::span<const ContactNotice> list_of_users(std::span<NodeContacts* const> node_contacts);

  /// The contacts of the frame before, in order of (a, b), and the keys of those that did not end after all, ascending.
  struct Before {
    std::span<const std::uint64_t> keys;
    std::span<const Contact> contacts;
    std::span<const Found> found;
    std::span<const std::uint64_t> passed;
  };
  /// All contacts that ended. `endings`: their keys, each list ascending.
  std::span<const ContactNotice> list_all_ended(std::span<const std::span<const std::uint64_t>> endings,
                                                const Before& before);
  /// Those of avatars, and of nodes that are gone: the keys `absent`.
  std::span<const ContactNotice> list_ended_of_users(std::span<NodeContacts* const> node_contacts,
                                                     std::span<const std::uint64_t> absent, const Before& before);

 private:
  void add(std::uint64_t key, NodeNumber node, const NodeContacts& from, const FoundContact& found,
           std::uint32_t position);
  std::span<const ContactNotice> list_ended(const Before& before);

  NodeContactOrder order_;
  base::PairSort ending_order_;
  base::FlatList<ContactNotice> notices_, ended_;
};

}  // namespace ringfence::nodes
