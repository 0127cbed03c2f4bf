#include "nodes/server/contacts/contact_notices.hpp"

#include <algorithm>

#include "nodes/server/contacts/search_from.hpp"

namespace ringfence::nodes {

void ContactNotices::reserve(std::size_t contacts) {
  order_.reserve_rarely_used(contacts);
  ending_order_.reserve_rarely_used(contacts);
  notices_.reserve_rarely_used(contacts);
}

std::span<const ContactNotice> ContactNotices::list_all(std::span<NodeContacts* const> node_contacts) {
  notices_.clear();
  order_.start(node_contacts);
  for (NodeNumber node = 0; node < node_contacts.size(); ++node) {
    for (std::uint32_t i = 0; i < node_contacts[node]->keys.size(); ++i) {
      order_.add(node, i);
    }
  }
  order_.sort();
  std::uint64_t last = 0;
  order_.visit([&](std::uint64_t key, NodeNumber node, std::uint32_t position, Phase) {
    if (key != last) {
      const NodeContacts& from = *node_contacts[node];
      add(key, node, from, from.found[position], position);
    }
    last = key;
  });
  return notices_.span();
}

std::span<const ContactNotice> ContactNotices::list_of_users(std::span<NodeContacts* const> node_contacts) {
  notices_.clear();
  for (NodeNumber node = 0; node < node_contacts.size(); ++node) {
    const NodeContacts& from = *node_contacts[node];
    for (const UserContact& contact : from.user_contacts) {
      from.prefetch(contact.found);
      add(contact.key, node, from, contact.found, contact.position);
    }
  }
  const auto by_key = [](const ContactNotice& p, const ContactNotice& q) { return p.key < q.key; };
  std::sort(notices_.begin(), notices_.end(), by_key);
  const auto same = [](const ContactNotice& p, const ContactNotice& q) { return p.key == q.key; };
  notices_.resize(static_cast<std::size_t>(std::unique(notices_.begin(), notices_.end(), same) - notices_.begin()));
  return notices_.span();
}

void ContactNotices::add(std::uint64_t key, NodeNumber node, const NodeContacts& from, const FoundContact& found,
                         std::uint32_t position) {
  notices_.push_back({key, &from, nullptr, found, {found.slot_a, found.slot_b, node}, from.phase(position)});
}

std::span<const ContactNotice> ContactNotices::list_all_ended(std::span<const std::span<const std::uint64_t>> endings,
                                                              const Before& before) {
  ending_order_.clear();
  for (const std::span<const std::uint64_t> keys : endings) {
    for (const std::uint64_t key : keys) {
      ending_order_.add(key);
    }
  }
  return list_ended(before);
}

std::span<const ContactNotice> ContactNotices::list_ended_of_users(std::span<NodeContacts* const> node_contacts,
                                                                   std::span<const std::uint64_t> absent,
                                                                   const Before& before) {
  ending_order_.clear();
  for (const NodeContacts* from : node_contacts) {
    for (const UserContact& contact : from->user_contacts_ending) {
      ending_order_.add(contact.key);
    }
  }
  for (const std::uint64_t key : absent) {
    ending_order_.add(key);
  }
  return list_ended(before);
}

std::span<const ContactNotice> ContactNotices::list_ended(const Before& before) {
  ended_.clear();
  ending_order_.sort();
  const std::uint64_t* const keys = before.keys.data();
  std::size_t at = 0;
  for (std::size_t i = 0; i < ending_order_.size(); ++i) {
    const std::uint64_t key = ending_order_.key_at(i);
    if (!std::binary_search(before.passed.begin(), before.passed.end(), key)) {
      at = static_cast<std::size_t>(search_from(keys + at, keys + before.keys.size(), key) - keys);
      ended_.push_back({key, nullptr, &before.contacts[at], {}, before.found[at], Phase::end});
    }
  }
  return ended_.span();
}

}  // namespace ringfence::nodes
