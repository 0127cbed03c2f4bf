#include "nodes/contact_ledger.hpp"

#include <algorithm>

namespace ringfence::nodes {

void ContactLedger::List::reserve(std::size_t size) {
  contacts.reserve(size);
  keys.reserve(size);
  found.reserve(size);
}

void ContactLedger::List::resize(std::size_t size) {
  contacts.resize(size);
  keys.resize(size);
  found.resize(size);
}

ContactLedger::ContactLedger(std::size_t nodes, std::size_t contacts) : runs_(nodes) {
  order_.reserve(contacts);
  ending_order_.reserve(contacts);
  told_.reserve(contacts);
  findings_.reserve(nodes);
  compared_.reserve(nodes);
  for (Edition& edition : editions_) {
    edition.live.reserve(contacts);
    edition.ended.reserve(contacts);
  }
}

void ContactLedger::resize(std::size_t nodes) { runs_.resize(nodes); }

void ContactLedger::begin(std::uint64_t frame) {
  frame_ = frame;
  for (Run& run : runs_) {
    run.shared = nullptr;
    run.own->start(frame);
    run.contacts.clear();
  }
  now().resize(0);
  ended().resize(0);
}

void ContactLedger::receive(NodeNumber node, const messages::CollisionRecord& record, std::span<const ObjectRow> rows) {
  Run& run = runs_[node];
  const ObjectRow& a = rows[record.slot_a];
  const ObjectRow& b = rows[record.slot_b];
  run.own->keys.push_back(ContactOrder::key(a.object.number, b.object.number));
  run.own->found.push_back({record.slot_a, record.slot_b});
  run.contacts.push_back(
      {a.object.number, b.object.number, Phase::persist, record.depth, record.normal, 0, record.point, a.pose, b.pose});
}

void ContactLedger::compare() {
  gather_findings();
  by_nodes_ = nodes_have_compared();
  gather_changes();
  follow();
  list_persisting();
  compared_.clear();
  for (const Run& run : runs_) {
    compared_.push_back(run.shared);
  }
}

void ContactLedger::gather_findings() {
  size_ = 0;
  findings_.clear();
  for (Run& run : runs_) {
    Findings& findings = run.findings();
    if (run.shared == nullptr) {
      findings.contacts = run.contacts.data();
    }
    findings.begun.clear();
    findings_.push_back(&findings);
    size_ += findings.keys.size();
  }
}

// Whether the lists that the nodes compared with are together, each contact once, those of the frame before.
bool ContactLedger::nodes_have_compared() const noexcept {
  return doubled_ == 0 && std::equal(runs_.begin(), runs_.end(), compared_.begin(), compared_.end(),
                                     [&](const Run& run, const Findings* compared) {
                                       return run.shared != nullptr && run.shared == compared &&
                                              run.shared->frame_before == frame_ - 1;
                                     });
}

// What may have begun into order_, and what may have ended into ending_order_, or all.
void ContactLedger::gather_changes() {
  order_.start(findings_);
  ending_order_.clear();
  for (NodeNumber node = 0; node < findings_.size(); ++node) {
    const Findings& findings = *findings_[node];
    if (!by_nodes_) {
      for (std::uint32_t i = 0; i < findings.keys.size(); ++i) {
        order_.add(node, i);
      }
      continue;
    }
    for (std::size_t i = 0; i < findings.beginning.size(); ++i) {
      order_.add(node, findings.beginning_at[i], findings.beginning[i]);
    }
    for (const std::uint64_t key : findings.ending) {
      ending_order_.add(key);
    }
  }
  order_.sort();
  ending_order_.sort();
}

// A pair that one node found no more and another did not find before has passed from one to the other, and persists.
void ContactLedger::follow() {
  const List& old = before();
  const std::size_t endings = by_nodes_ ? ending_order_.size() : old.keys.size();
  const auto ending_key = [&](std::size_t i) { return by_nodes_ ? ending_order_.key_at(i) : old.keys[i]; };
  std::size_t next = 0;
  std::uint64_t last = 0;
  std::uint64_t going_on = 0;
  began_ = 0;
  const auto end_until = [&](std::uint64_t key) {
    for (; next < endings && ending_key(next) < key; ++next) {
      if (ending_key(next) != going_on) {
        ended().keys.push_back(ending_key(next));
      }
    }
  };
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::uint64_t key = order_.key(i);
    end_until(key);
    if (next < endings && ending_key(next) == key) {
      going_on = key;
    } else {
      findings_[order_.node(i)]->begun.push_back(order_.position(i));
      began_ += key != last ? 1 : 0;
    }
    last = key;
  }
  end_until(~std::uint64_t{0});
  ended().contacts.resize(ended().keys.size());
}

void ContactLedger::list_persisting() {
  for (Run& run : runs_) {
    const Findings& findings = run.findings();
    run.persists.assign(run.shared != nullptr ? 0 : (findings.keys.size() + 63) / 64, ~std::uint64_t{0});
    if (run.shared == nullptr) {
      for (const std::uint32_t i : findings.begun) {
        run.persists[i / 64] &= ~(std::uint64_t{1} << (i % 64));
      }
    }
  }
}

// Any cut is right; those of the frame before are nearly even.
std::uint64_t ContactLedger::key_at(std::size_t share, std::size_t shares) const noexcept {
  if (share == 0 || share == shares) {
    return share == 0 ? 0 : ~std::uint64_t{0};
  }
  const auto* keys = &before().keys;
  if (keys->empty()) {
    for (const Findings* findings : findings_) {
      keys = findings->keys.size() > keys->size() ? &findings->keys : keys;
    }
  }
  return keys->empty() ? 0 : (*keys)[share * keys->size() / shares];
}

void ContactLedger::share_out() {
  List& list = now();
  list.resize(size_);
  doubled_ = 0;
  const auto shares = static_cast<std::size_t>(
      std::count_if(runs_.begin(), runs_.end(), [](const Run& run) { return run.shared != nullptr; }));
  List& gone = ended();
  const std::size_t ends = gone.keys.size();
  Stretch stretch;
  stretch.findings = findings_;
  stretch.end_key = ~std::uint64_t{0};
  stretch.contacts = list.contacts.data();
  stretch.keys = list.keys.data();
  stretch.found = list.found.data();
  stretch.ended_keys = gone.keys.span();
  stretch.ended = gone.contacts.data();
  stretch.keys_before = before().keys.span();
  stretch.contacts_before = before().contacts.data();
  if (shares == 0) {
    doubled_ = write_stretch(stretch, order_);
    return;
  }
  std::size_t share = 0;
  for (const Run& run : runs_) {
    if (run.shared != nullptr) {
      const std::size_t first = share * ends / shares;
      const std::size_t end = (share + 1) * ends / shares;
      stretch.first_key = key_at(share, shares);
      stretch.end_key = key_at(share + 1, shares);
      stretch.ended_keys = gone.keys.span().subspan(first, end - first);
      stretch.ended = gone.contacts.data() + first;
      ++share;
      run.shared->stretch = stretch;
      run.shared->doubled = run.shared->taken = 0;
      run.shared->gate.admit();
    }
  }
}

void ContactLedger::lose(NodeNumber node) {
  Findings* const shared = runs_[node].shared;
  if (shared != nullptr && shared->gate.bar()) {
    doubled_ += write_stretch(shared->stretch, order_);
  }
}

bool ContactLedger::complete() {
  const auto is_inside = [](const Run& run) { return run.shared != nullptr && run.shared->gate.is_inside(); };
  if (std::any_of(runs_.begin(), runs_.end(), is_inside)) {
    return false;
  }
  for (const Run& run : runs_) {
    doubled_ += run.shared != nullptr ? run.shared->doubled : 0;
  }
  if (doubled_ != 0) [[unlikely]] {
    drop_doubled();
  }
  return true;
}

// Who found one beyond once may have taken it for one that begins: its phase is made out anew.
void ContactLedger::drop_doubled() {
  List& list = now();
  const auto& keys = before().keys;
  std::size_t kept = 0;
  began_ = 0;
  for (std::size_t i = 0; i < list.keys.size(); ++i) {
    if (kept == 0 || list.keys[i] != list.keys[kept - 1]) {
      const bool persists = std::binary_search(keys.begin(), keys.end(), list.keys[i]);
      began_ += persists ? 0 : 1;
      list.contacts[kept] = list.contacts[i];
      list.contacts[kept].phase = persists ? Phase::persist : Phase::begin;
      list.keys[kept] = list.keys[i];
      list.found[kept] = list.found[i];
      ++kept;
    }
  }
  list.resize(kept);
}

std::span<const ToldContact> ContactLedger::told(bool all) {
  told_.clear();
  if (!all) {
    tell_outer();
    return told_.span();
  }
  order_.start(findings_);
  for (NodeNumber node = 0; node < findings_.size(); ++node) {
    for (std::uint32_t i = 0; i < findings_[node]->keys.size(); ++i) {
      order_.add(node, i);
    }
  }
  order_.sort();
  std::uint64_t last = 0;
  order_.visit([&](std::uint64_t key, NodeNumber node, std::uint32_t position, Phase phase) {
    if (key != last) {
      const FoundContact& found = findings_[node]->found[position];
      told_.push_back({key, findings_[node], position, nullptr, {found.slot_a, found.slot_b, node}, phase});
    }
    last = key;
  });
  return told_.span();
}

// Few.
void ContactLedger::tell_outer() {
  for (NodeNumber node = 0; node < findings_.size(); ++node) {
    const Findings& findings = *findings_[node];
    for (const OuterContact& outer : findings.outer) {
      findings.fetch(outer.position);
      told_.push_back({outer.key,
                       &findings,
                       outer.position,
                       nullptr,
                       {outer.found.slot_a, outer.found.slot_b, node},
                       findings.begins(outer.position) ? Phase::begin : Phase::persist});
    }
  }
  const auto by_key = [](const ToldContact& p, const ToldContact& q) { return p.key < q.key; };
  std::sort(told_.begin(), told_.end(), by_key);
  const auto same = [](const ToldContact& p, const ToldContact& q) { return p.key == q.key; };
  told_.resize(static_cast<std::size_t>(std::unique(told_.begin(), told_.end(), same) - told_.begin()));
}

std::span<const ToldContact> ContactLedger::told_ended(bool all) {
  told_ended_.clear();
  const auto& keys = ended().keys;
  std::size_t old = 0;
  if (all || !by_nodes_) {
    for (const std::uint64_t key : keys) {
      tell_ended(key, old);
    }
    return told_ended_.span();
  }
  ending_order_.clear();
  for (const Findings* findings : findings_) {
    for (const OuterContact& outer : findings->outer_ending) {
      ending_order_.add(outer.key);
    }
  }
  ending_order_.sort();
  for (std::size_t i = 0; i < ending_order_.size(); ++i) {
    // It may have passed to another node.
    if (std::binary_search(keys.begin(), keys.end(), ending_order_.key_at(i))) {
      tell_ended(ending_order_.key_at(i), old);
    }
  }
  return told_ended_.span();
}

void ContactLedger::tell_ended(std::uint64_t key, std::size_t& old) {
  const auto& keys = before().keys;
  const auto* const at = leap_to(keys.begin() + old, keys.end(), key);
  old = static_cast<std::size_t>(at - keys.begin());
  told_ended_.push_back({key, nullptr, 0, &before().contacts[old], before().found[old], Phase::end});
}

}  // namespace ringfence::nodes
