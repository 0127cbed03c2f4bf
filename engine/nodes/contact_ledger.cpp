#include "nodes/contact_ledger.hpp"

#include <algorithm>
#include <utility>

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

ContactLedger::ContactLedger(std::size_t nodes, std::size_t contacts) : runs_(nodes) {
  order_.reserve(contacts);
  finders_.reserve(contacts);
  ending_.reserve(contacts);
  written_.reserve(contacts / 64 + 1);
  for (Edition& edition : editions_) {
    edition.live.reserve(contacts);
    edition.ended.reserve(contacts);
  }
}

void ContactLedger::begin(std::uint64_t frame) {
  frame_ = frame;
  began_ = 0;
  left_to_nodes_ = false;
  for (Run& run : runs_) {
    run.shared = nullptr;
    run.own.keys.clear();
    run.records.clear();
  }
  editions_[frame & 1].live.clear();
  editions_[frame & 1].ended.clear();
}

std::uint64_t ContactLedger::merge() {
  ending_.clear();
  gather_keys();
  if (!ascending_) {
    order_.sort();
  }
  std::size_t old = 0;
  std::uint64_t last = 0;
  std::uint64_t doubled = 0;
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::size_t received = ascending_ ? i : order_.at(i);
    const std::uint64_t key = order_.added(received);
    if (key == last) {
      ++doubled;
      Run& run = runs_[finders_[received]];
      run.ranks()[received - run.first] = Findings::written;
    } else {
      follow(received, key, old);
      last = key;
    }
  }
  end_until(old, ~std::uint64_t{0});
  return doubled;
}

void ContactLedger::gather_keys() {
  order_.clear();
  finders_.clear();
  ascending_ = true;
  std::uint64_t last = 0;
  for (NodeNumber node = 0; node < runs_.size(); ++node) {
    Run& run = runs_[node];
    const std::size_t size = run.keys().size();
    run.first = order_.size();
    run.ranks().resize(size);
    run.persists.assign(run.shared != nullptr ? 0 : (size + 63) / 64, 0);
    finders_.resize(run.first + size);
    std::fill(finders_.begin() + run.first, finders_.end(), node);
    for (const std::uint64_t key : run.keys()) {
      ascending_ &= key > last;
      last = key;
      order_.add(key);
    }
  }
}

// The next key of all, beside those of the frame before.
void ContactLedger::follow(std::size_t received, std::uint64_t key, std::size_t& old) {
  List& now = editions_[frame_ & 1].live;
  const List& before = editions_[(frame_ - 1) & 1].live;
  end_until(old, key);
  Run& run = runs_[finders_[received]];
  const std::size_t i = received - run.first;
  const auto rank = static_cast<std::uint32_t>(now.keys.size());
  if (old < before.keys.size() && before.keys[old] == key) {
    ++old;
    run.ranks()[i] = rank;
    if (run.shared == nullptr) {
      run.persists[i / 64] |= std::uint64_t{1} << (i % 64);
    }
  } else {
    ++began_;
    run.ranks()[i] = rank | Findings::begins;
  }
  now.keys.push_back(key);
}

// What was in contact before and has a smaller key than the next contact is in contact no more.
void ContactLedger::end_until(std::size_t& old, std::uint64_t key) {
  const List& before = editions_[(frame_ - 1) & 1].live;
  while (old < before.keys.size() && before.keys[old] < key) {
    ending_.push_back(static_cast<std::uint32_t>(old));
    ++old;
  }
}

void ContactLedger::write(std::span<const ObjectRow> rows, bool all) {
  constexpr std::size_t ahead = 10;  // neither list is in the cache
  List& now = editions_[frame_ & 1].live;
  now.contacts.resize(now.keys.size());
  now.found.resize(now.keys.size());
  written_.assign((now.keys.size() + 63) / 64, 0);
  left_to_nodes_ = !all;
  for (NodeNumber node = 0; node < runs_.size(); ++node) {
    Findings* const findings = runs_[node].shared;
    if (findings == nullptr) {
      write_received(node, rows);
      continue;
    }
    findings->live = now.contacts.data();
    findings->ledger_found = now.found.data();
    const std::size_t size = all ? findings->keys.size() : findings->outer.size();
    const auto at = [&](std::size_t i) { return all ? i : i < size ? findings->outer[i] : findings->found.size(); };
    for (std::size_t i = 0; i < size; ++i) {
      findings->fetch(at(i + ahead));
      write_shared(node, at(i));
    }
  }
  write_ended();
}

void ContactLedger::write_shared(NodeNumber node, std::size_t i) {
  Findings& findings = *runs_[node].shared;
  std::uint32_t& rank = findings.ranks[i];
  if ((rank & Findings::written) == 0) {
    findings.write(i, node, findings.live, findings.ledger_found);
    note_written(rank & Findings::rank_mask);
    rank |= Findings::written;
  }
}

void ContactLedger::write_received(NodeNumber node, std::span<const ObjectRow> rows) {
  // Two frames of contacts take turns, and 64,000 rows are too many for the second-level cache.
  constexpr std::size_t ahead = 12;
  Run& run = runs_[node];
  List& now = editions_[frame_ & 1].live;
  for (std::size_t i = 0; i < run.records.size(); ++i) {
    if (i + ahead < run.records.size()) {
      const messages::CollisionRecord& soon = run.records[i + ahead];
      __builtin_prefetch(&rows[soon.slot_a]);
      __builtin_prefetch(&rows[soon.slot_b]);
      const auto* room =
          reinterpret_cast<const std::byte*>(&now.contacts[run.own.ranks[i + ahead] & Findings::rank_mask]);
      __builtin_prefetch(room, 1);
      __builtin_prefetch(room + 64, 1);
      __builtin_prefetch(room + sizeof(Contact) - 1, 1);
    }
    const std::uint32_t rank = run.own.ranks[i] & Findings::rank_mask;
    if ((run.own.ranks[i] & Findings::written) != 0) {
      continue;
    }
    const messages::CollisionRecord& record = run.records[i];
    const std::uint64_t key = run.own.keys[i];
    Contact& contact = now.contacts[rank];
    contact.a = static_cast<ObjectNumber>(key >> 32);
    contact.b = static_cast<ObjectNumber>(key);
    contact.phase = Findings::phase_of(run.own.ranks[i]);
    contact.depth = record.depth;
    contact.normal = record.normal;
    contact.reserved = 0;
    contact.point = record.point;
    contact.pose_a = rows[record.slot_a].pose;
    contact.pose_b = rows[record.slot_b].pose;
    now.found[rank] = {record.slot_a, record.slot_b, node};
    note_written(rank);
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

// A lost node's thread may be late rather than dead, and write what it was told to write in any later frame. So the
// list goes where it does not know of, and the old one stays until its thread has ended.
void ContactLedger::take_over(std::span<const NodeNumber> lost) {
  if (!left_to_nodes_) {
    return;
  }
  List& now = editions_[frame_ & 1].live;
  List fresh;
  fresh.contacts.resize(now.contacts.size());
  fresh.found.resize(now.found.size());
  for (NodeNumber node = 0; node < runs_.size(); ++node) {
    Run& run = runs_[node];
    const bool is_lost = run.shared != nullptr && std::find(lost.begin(), lost.end(), node) != lost.end();
    for (std::size_t i = 0; i < run.ranks().size(); ++i) {
      const std::uint32_t rank = run.ranks()[i] & Findings::rank_mask;
      if (is_lost && (run.ranks()[i] & Findings::written) == 0) {
        run.shared->write(i, node, fresh.contacts.data(), fresh.found.data());
      } else {
        fresh.contacts[rank] = now.contacts[rank];
        fresh.found[rank] = now.found[rank];
      }
    }
  }
  fresh.keys = std::move(now.keys);
  retired_.push_back(std::move(now));
  now = std::move(fresh);
}

}  // namespace ringfence::nodes
