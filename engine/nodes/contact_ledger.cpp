#include "nodes/contact_ledger.hpp"

#include <algorithm>

namespace ringfence::nodes {

void ContactLedger::List::reserve(std::size_t size) {
  contacts.reserve(size);
  keys.reserve(size);
  found.reserve(size);
}

void ContactLedger::List::clear() noexcept {
  contacts.clear();
  keys.clear();
  found.clear();
}

ContactLedger::ContactLedger(std::size_t nodes, std::size_t contacts) : received_(nodes), persists_(nodes) {
  // A node's share is rarely more than twice the mean; what is more grows once.
  const std::size_t share = std::min(contacts, 2 * contacts / nodes + 64);
  for (auto& persists : persists_) {
    persists.reserve(share / 64 + 1);
  }
  order_.reserve(contacts);
  records_.reserve(contacts);
  sources_.reserve(contacts);
  merged_.reserve(contacts);
  newcomers_.reserve(contacts);
  ending_.reserve(contacts);
  for (Edition& edition : editions_) {
    edition.live.reserve(contacts);
    edition.ended.reserve(contacts);
  }
}

void ContactLedger::begin(std::uint64_t frame) {
  frame_ = frame;
  newcomers_.clear();
  std::fill(received_.begin(), received_.end(), 0u);
  order_.clear();
  records_.clear();
  sources_.clear();
  last_key_ = 0;
  ascending_ = true;
  editions_[frame & 1].live.clear();
  editions_[frame & 1].ended.clear();
}

std::uint64_t ContactLedger::merge(std::span<const ObjectRow> rows) {
  const std::uint64_t doubled = merge_keys();
  write_contacts(rows);
  write_ended();
  return doubled;
}

std::uint64_t ContactLedger::merge_keys() {
  merged_.clear();
  newcomers_.clear();
  ending_.clear();
  for (std::size_t node = 0; node < received_.size(); ++node) {
    persists_[node].assign((received_[node] + 63) / 64, 0);
  }
  if (!ascending_) {
    order_.sort();
  }
  std::size_t old = 0;
  std::uint64_t last = 0;
  std::uint64_t doubled = 0;
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::uint32_t received = ascending_ ? static_cast<std::uint32_t>(i) : order_.at(i);
    const std::uint64_t key = order_.added(received);
    if (key == last) {
      ++doubled;
    } else {
      follow(received, key, old);
      last = key;
    }
  }
  end_until(old, ~std::uint64_t{0});
  return doubled;
}

// The next key of all, beside those of the frame before.
void ContactLedger::follow(std::uint32_t received, std::uint64_t key, std::size_t& old) {
  List& now = editions_[frame_ & 1].live;
  const List& before = editions_[(frame_ - 1) & 1].live;
  end_until(old, key);
  if (old < before.keys.size() && before.keys[old] == key) {
    ++old;
    const auto [node, index] = sources_[received];
    persists_[node][index / 64] |= std::uint64_t{1} << (index % 64);
  } else {
    newcomers_.push_back(static_cast<std::uint32_t>(now.keys.size()));
  }
  now.keys.push_back(key);
  merged_.push_back(received);
}

// What was in contact before and has a smaller key than the next contact is in contact no more.
void ContactLedger::end_until(std::size_t& old, std::uint64_t key) {
  const List& before = editions_[(frame_ - 1) & 1].live;
  while (old < before.keys.size() && before.keys[old] < key) {
    ending_.push_back(static_cast<std::uint32_t>(old));
    ++old;
  }
}

void ContactLedger::write_contacts(std::span<const ObjectRow> rows) {
  // Two frames of contacts take turns, and 64,000 rows are too many for the second-level cache.
  constexpr std::size_t far = 24;
  constexpr std::size_t ahead = 12;
  List& now = editions_[frame_ & 1].live;
  now.contacts.resize(merged_.size());
  now.found.resize(merged_.size());
  std::size_t newcomer = 0;
  for (std::size_t i = 0; i < merged_.size(); ++i) {
    if (i + far < merged_.size()) {
      const auto* soon = reinterpret_cast<const std::byte*>(&records_[merged_[i + far]]);
      __builtin_prefetch(soon);
      __builtin_prefetch(soon + sizeof(messages::CollisionRecord) - 1);
    }
    if (i + ahead < merged_.size()) {
      const messages::CollisionRecord& soon = records_[merged_[i + ahead]];
      __builtin_prefetch(&rows[soon.slot_a]);
      __builtin_prefetch(&rows[soon.slot_b]);
      const auto* room = reinterpret_cast<const std::byte*>(&now.contacts[i + ahead]);
      __builtin_prefetch(room, 1);
      __builtin_prefetch(room + 64, 1);
      __builtin_prefetch(room + sizeof(Contact) - 1, 1);
    }
    const messages::CollisionRecord& record = records_[merged_[i]];
    const NodeNumber node = sources_[merged_[i]].node;
    const std::uint64_t key = now.keys[i];
    Contact& contact = now.contacts[i];
    contact.a = static_cast<ObjectNumber>(key >> 32);
    contact.b = static_cast<ObjectNumber>(key);
    const bool begins = newcomer < newcomers_.size() && newcomers_[newcomer] == i;
    newcomer += begins ? 1 : 0;
    contact.phase = begins ? Phase::begin : Phase::persist;
    contact.depth = record.depth;
    contact.normal = record.normal;
    contact.reserved = 0;
    contact.point = record.point;
    contact.pose_a = rows[record.slot_a].pose;
    contact.pose_b = rows[record.slot_b].pose;
    now.found[i] = {record.slot_a, record.slot_b, node};
  }
}

void ContactLedger::write_ended() {
  constexpr std::size_t ahead = 8;
  const List& before = editions_[(frame_ - 1) & 1].live;
  List& ended = editions_[frame_ & 1].ended;
  for (std::size_t i = 0; i < ending_.size(); ++i) {
    if (i + ahead < ending_.size()) {
      const auto* soon = reinterpret_cast<const std::byte*>(&before.contacts[ending_[i + ahead]]);
      __builtin_prefetch(soon);
      __builtin_prefetch(soon + 64);
      __builtin_prefetch(soon + sizeof(Contact) - 1);
    }
    const std::uint32_t old = ending_[i];
    ended.contacts.push_back(before.contacts[old]);
    ended.contacts.back().phase = Phase::end;
    ended.keys.push_back(before.keys[old]);
    ended.found.push_back(before.found[old]);
  }
}

}  // namespace ringfence::nodes
