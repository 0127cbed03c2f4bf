#include "nodes/contact_ledger.hpp"

#include <algorithm>

#include "nodes/contact_order.hpp"

namespace ringfence::nodes {

namespace {

std::uint64_t key_of(const Contact& contact) noexcept { return ContactOrder::key(contact.a, contact.b); }

}  // namespace

ContactLedger::ContactLedger(std::size_t nodes, std::size_t contacts) : received_(nodes) {
  // A node's share is rarely more than twice the mean; what is more grows once.
  for (auto& run : received_) {
    run.reserve(std::min(contacts, 2 * contacts / nodes + 64));
  }
  heap_.reserve(nodes);
  for (Edition& edition : editions_) {
    edition.contacts.reserve(contacts);
    edition.slots.reserve(contacts);
    edition.ended.reserve(contacts);
    edition.ended_slots.reserve(contacts);
  }
}

void ContactLedger::begin(std::uint64_t frame) {
  frame_ = frame;
  began_ = 0;
  for (auto& run : received_) {
    run.clear();
  }
  Edition& edition = editions_[frame & 1];
  edition.contacts.clear();
  edition.slots.clear();
  edition.ended.clear();
  edition.ended_slots.clear();
}

// What was in contact before and has a smaller key than the next contact is in contact no more.
void ContactLedger::end_until(const Edition& before, std::size_t& old, std::uint64_t key) {
  Edition& now = editions_[frame_ & 1];
  while (old < before.contacts.size() && key_of(before.contacts[old]) < key) {
    now.ended.push_back(before.contacts[old]);
    now.ended.back().phase = Phase::end;
    now.ended_slots.push_back(before.slots[old]);
    ++old;
  }
}

void ContactLedger::accept(const messages::CollisionRecord& record, const Edition& before, std::size_t& old) {
  Edition& now = editions_[frame_ & 1];
  const std::uint64_t key = key_of(record.contact);
  end_until(before, old, key);
  const bool persists = old < before.contacts.size() && key_of(before.contacts[old]) == key;
  old += persists ? 1 : 0;
  began_ += persists ? 0 : 1;
  now.contacts.push_back(record.contact);
  now.contacts.back().phase = persists ? Phase::persist : Phase::begin;
  now.slots.push_back({record.slot_a, record.slot_b});
}

std::uint64_t ContactLedger::merge() {
  const auto later = [](const Run& p, const Run& q) { return key_of(p.next->contact) > key_of(q.next->contact); };
  heap_.clear();
  for (const auto& run : received_) {
    if (!run.empty()) {
      heap_.push_back({run.data(), run.data() + run.size()});
    }
  }
  std::make_heap(heap_.begin(), heap_.end(), later);
  const Edition& before = editions_[(frame_ - 1) & 1];
  std::size_t old = 0;
  std::uint64_t last = 0;
  std::uint64_t doubled = 0;
  while (!heap_.empty()) {
    if (heap_.size() > 1) {
      std::pop_heap(heap_.begin(), heap_.end(), later);
    }
    Run& run = heap_.back();
    // A run is taken on for as long as no other has anything smaller: neighbouring pairs tend to share a node.
    const std::uint64_t limit = heap_.size() > 1 ? key_of(heap_.front().next->contact) : ~std::uint64_t{0};
    do {
      const std::uint64_t key = key_of(run.next->contact);
      if (key == last) {
        ++doubled;
      } else {
        accept(*run.next, before, old);
        last = key;
      }
      ++run.next;
    } while (run.next != run.end && key_of(run.next->contact) <= limit);
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
