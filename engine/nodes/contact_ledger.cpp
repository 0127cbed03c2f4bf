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
  for (std::size_t node = 0; node < nodes; ++node) {
    received_[node].reserve(share);
    persists_[node].reserve(share / 64 + 1);
  }
  heap_.reserve(nodes);
  for (Edition& edition : editions_) {
    edition.live.reserve(contacts);
    edition.ended.reserve(contacts);
  }
}

void ContactLedger::begin(std::uint64_t frame) {
  frame_ = frame;
  began_ = 0;
  for (auto& run : received_) {
    run.clear();
  }
  editions_[frame & 1].live.clear();
  editions_[frame & 1].ended.clear();
}

// What was in contact before and has a smaller key than the next contact is in contact no more.
void ContactLedger::end_until(const List& before, std::size_t& old, std::uint64_t key) {
  List& ended = editions_[frame_ & 1].ended;
  while (old < before.keys.size() && before.keys[old] < key) {
    ended.contacts.push_back(before.contacts[old]);
    ended.contacts.back().phase = Phase::end;
    ended.keys.push_back(before.keys[old]);
    ended.found.push_back(before.found[old]);
    ++old;
  }
}

// Returns whether the contact persists.
bool ContactLedger::accept(const Received& received, NodeNumber node, const List& before, std::size_t& old,
                           std::span<const ObjectRow> rows) {
  List& now = editions_[frame_ & 1].live;
  const auto& [key, record] = received;
  end_until(before, old, key);
  const bool persists = old < before.keys.size() && before.keys[old] == key;
  old += persists ? 1 : 0;
  began_ += persists ? 0 : 1;
  Contact& contact = now.contacts.add();
  // Two frames of contacts take turns, so these lines are not in the cache either.
  constexpr std::ptrdiff_t lines_ahead = 1024;
  __builtin_prefetch(reinterpret_cast<const std::byte*>(&contact) + lines_ahead, 1);
  __builtin_prefetch(reinterpret_cast<const std::byte*>(&contact) + lines_ahead + 64, 1);
  contact.a = static_cast<ObjectNumber>(key >> 32);
  contact.b = static_cast<ObjectNumber>(key);
  contact.phase = persists ? Phase::persist : Phase::begin;
  contact.depth = record.depth;
  contact.normal = record.normal;
  contact.reserved = 0;
  contact.point = record.point;
  contact.pose_a = rows[record.slot_a].pose;
  contact.pose_b = rows[record.slot_b].pose;
  now.keys.push_back(key);
  now.found.push_back({record.slot_a, record.slot_b, node});
  return persists;
}

std::uint64_t ContactLedger::merge(std::span<const ObjectRow> rows) {
  const auto later = [](const Run& p, const Run& q) { return p.next->key > q.next->key; };
  heap_.clear();
  for (NodeNumber node = 0; node < received_.size(); ++node) {
    const auto& run = received_[node];
    persists_[node].assign((run.size() + 63) / 64, 0);
    if (!run.empty()) {
      heap_.push_back({run.data(), run.data() + run.size(), node});
    }
  }
  std::make_heap(heap_.begin(), heap_.end(), later);
  const List& before = editions_[(frame_ - 1) & 1].live;
  std::size_t old = 0;
  std::uint64_t last = 0;
  std::uint64_t doubled = 0;
  while (!heap_.empty()) {
    if (heap_.size() > 1) {
      std::pop_heap(heap_.begin(), heap_.end(), later);
    }
    Run& run = heap_.back();
    const Received* const first = received_[run.node].data();
    std::uint64_t* const persists = persists_[run.node].data();
    // A run is taken on for as long as no other has anything smaller: neighbouring pairs tend to share a node.
    const std::uint64_t limit = heap_.size() > 1 ? heap_.front().next->key : ~std::uint64_t{0};
    do {
      // The second object's row lies anywhere: 64,000 rows are too many for the second-level cache.
      constexpr std::ptrdiff_t ahead = 12;
      if (run.end - run.next > ahead) {
        __builtin_prefetch(&rows[run.next[ahead].record.slot_a]);
        __builtin_prefetch(&rows[run.next[ahead].record.slot_b]);
      }
      const std::uint64_t key = run.next->key;
      if (key == last) {
        ++doubled;
      } else {
        const auto i = static_cast<std::size_t>(run.next - first);
        const bool persist = accept(*run.next, run.node, before, old, rows);
        persists[i / 64] |= std::uint64_t{persist} << (i % 64);
        last = key;
      }
      ++run.next;
    } while (run.next != run.end && run.next->key <= limit);
    if (run.next == run.end) {
      heap_.pop_back();
    } else {
      std::push_heap(heap_.begin(), heap_.end(), later);
    }
  }
  end_until(before, old, ~std::uint64_t{0});
  return doubled;
}

}  // namespace ringfence::nodes
