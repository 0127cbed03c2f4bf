#include "nodes/server/contacts/contact_ledger.hpp"

#include <algorithm>
#include <utility>

#include "base/prefetch.hpp"
#include "geometry/vector.hpp"

namespace ringfence::nodes {
namespace {

/// Exponential search for the first of ascending keys that is not below `key`; fast if it is near `first`.
const std::uint64_t* search_from(const std::uint64_t* first, const std::uint64_t* end, std::uint64_t key) noexcept {
  std::ptrdiff_t stride = 1;
  while (stride < end - first && first[stride] < key) {
    first += stride;
    stride *= 2;
  }
  return std::lower_bound(first, first + std::min(stride + 1, end - first), key);
}

/// Whether one of the two objects is an avatar.
bool has_avatar(const ContactObjects& objects, std::uint32_t a, std::uint32_t b) noexcept {
  return ((objects.marks[a] | objects.marks[b]) & avatar_mark) != 0;
}

}  // namespace

ContactLedger::ContactLedger(std::size_t nodes, std::size_t contacts, std::uint32_t deepest_contacts,
                             std::size_t frames)
    : runs_(nodes), deepest_contacts_(deepest_contacts), keeps_two_(frames == 2) {
  order_.reserve_rarely_used(contacts);
  ending_order_.reserve_rarely_used(contacts);
  scratch_.reserve(contacts);
  notices_.reserve_rarely_used(contacts);
  endings_.reserve(nodes);
  for (std::size_t i = 0; i < frames; ++i) {
    live_[i].reserve(contacts);
  }
  ended_[0].reserve(contacts);
  ended_[1].reserve(contacts);
}

void ContactLedger::restore(std::uint64_t frame, std::span<Contact> contacts, const ObjectTable& objects) {
  frame_ = frame;
  any_lost_ = false;
  List& list = live_[parity(frame - 1)];
  list.resize(contacts.size());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    Contact& contact = contacts[i];
    const std::uint32_t a = objects.find(contact.a), b = objects.find(contact.b);
    NodeContacts::complete(contact, objects.row(a), objects.origin(a), objects.row(b), objects.origin(b));
    list.contacts[i] = contact;
    list.keys[i] = base::PairSort::key(contact.a, contact.b);
    list.found[i] = {a, b, 0};
  }
  for (Run& run : runs_) {
    run.joined = frame;
  }
  participants_ = 1;  // a node that is gone
}

void ContactLedger::resize(std::size_t nodes) { runs_.resize(nodes); }

void ContactLedger::begin(std::uint64_t frame) {
  frame_ = frame;
  if (std::exchange(written_again_, false) && !abandoned_.empty()) {
    abandoned_.back().before = std::exchange(now(), {});
    abandoned_.back().ended_before = std::exchange(ended(), {});
  }
  node_contacts_.resize(runs_.size());
  summaries_.resize(runs_.size());
  for (NodeNumber node = 0; node < runs_.size(); ++node) {
    Run& run = runs_[node];
    // A run whose contacts were shared has none of its own.
    if (std::exchange(run.shared, nullptr) == nullptr) {
      run.own->start(frame);
      run.touches.clear();
      run.ended_at.clear();
      run.corrections.clear();
    }
    run.complete = false;
    node_contacts_[node] = run.own.get();
    summaries_[node] = {};
  }
  if (keeps_two_) {
    now().resize(0);
  }
  ended().resize(0);
}

bool ContactLedger::receive(NodeNumber node, const messages::CollisionRecord& record, const ContactObjects& objects) {
  Run& run = runs_[node];
  if (record.slot_a >= objects.numbers.size() || record.slot_b >= objects.numbers.size()) {
    return false;
  }
  const ObjectNumber a = objects.numbers[record.slot_a];
  const ObjectNumber b = objects.numbers[record.slot_b];
  const std::uint64_t key = base::PairSort::key(a, b);
  auto& keys = run.own->keys;
  if (a >= b || (keys.size() != 0 && key < keys[keys.size() - 1])) {
    return false;
  }
  const auto position = static_cast<std::uint32_t>(keys.size());
  const FoundContact found{record.slot_a, record.slot_b, 0, 0, position};
  if (has_avatar(objects, record.slot_a, record.slot_b)) {
    run.own->user_contacts.push_back({key, position, found});
  }
  keys.push_back(key);
  run.own->found.push_back(found);
  run.touches.push_back({0, record.depth, record.normal, record.point});
  run.own->rows = objects.rows.data();
  run.own->origins = objects.origins.data();
  return true;
}

bool ContactLedger::receive(NodeNumber node, const messages::ChangeRecord& record) {
  Run& run = runs_[node];
  NodeContacts& own = *run.own;
  const bool at_border = (record.flags & messages::change_at_border) != 0;
  if ((record.flags & messages::change_ended) != 0) {
    const List& old = before();
    const bool ordered = own.ending.empty() || own.ending.back() <= record.key;
    const std::uint64_t* const keys = old.keys.data();
    const std::uint64_t* const end = keys + old.keys.size();
    const std::size_t last = run.ended_at.empty() ? 0 : run.ended_at.back();
    const std::uint64_t* const found = ordered ? search_from(keys + last, end, record.key) : end;
    if (found == end || *found != record.key) {
      return false;
    }
    run.ended_at.push_back(static_cast<std::uint32_t>(found - keys));
    own.ending.push_back(record.key);
    if (at_border) {
      own.border_ending.push_back(record.key);
    }
    return true;
  }
  const bool ordered = own.beginning.empty() || own.beginning.back() < record.position;
  if (!ordered || record.position >= own.keys.size() || own.keys[record.position] != record.key) {
    return false;
  }
  own.beginning.push_back(record.position);
  if (at_border) {
    own.border_beginning.push_back({record.key, record.position});
  }
  return true;
}

void ContactLedger::end_run(NodeNumber node, const ContactObjects& objects) {
  constexpr std::size_t ahead = 8;
  Run& run = runs_[node];
  const base::FlatList<Found>& old = before().found;
  for (std::size_t i = 0; i < run.ended_at.size(); ++i) {
    if (i + ahead < run.ended_at.size()) {
      base::prefetch_for_read(&old[run.ended_at[i + ahead]]);
    }
    const Found& found = old[run.ended_at[i]];
    if (has_avatar(objects, found.a, found.b)) {
      run.own->user_contacts_ending.push_back({run.own->ending[i], 0, {found.a, found.b}});
    }
  }
  run.complete = true;
  run.own->touches = run.touches.data();
  run.own->begun.resize(run.own->keys.size());
  std::fill(run.own->begun.begin(), run.own->begun.end(), std::uint8_t{0});
  for (const std::uint32_t position : run.own->beginning) {
    run.own->begun[position] = 1;
  }
  run.own->summarize();
  take(node, *run.own);
}

void ContactLedger::resolve_phases() {
  if (deepest_contacts_ != 0) {
    unlist();
  }
  matches_.start();
  add_summaries();
  end_absent();
  match_borders();
}

void ContactLedger::unlist() {
  deepest_.rank(deepest_contacts_, node_contacts_);
  unlisted_ = deepest_.size();
  for (NodeNumber node = 0; node < node_contacts_.size(); ++node) {
    Run& run = runs_[node];
    run.unlisted.clear();
    const auto positions = deepest_.unlisted(node);
    for (std::size_t i = 0; run.shared == nullptr && i < positions.size(); ++i) {
      const FoundContact& found = run.own->found[positions[i]];
      run.unlisted.push_back({run.own->keys[positions[i]], found.slot_a, found.slot_b});
    }
    node_contacts_[node]->unlist(positions);
    take(node, *node_contacts_[node]);
  }
}

void ContactLedger::add_summaries() {
  endings_.clear();
  size_ = began_ = ends_ = 0;
  for (const ContactSummary& summary : summaries_) {
    matches_.add_endings(summary.border_ending);
    endings_.push_back(summary.ending);
    size_ += summary.contacts;
    began_ += summary.began;
    ends_ += summary.ending.size();
  }
}

// No node reports the end of the contacts of an absent one.
void ContactLedger::end_absent() {
  absent_.clear();
  const auto complete = [](const Run& run) { return run.complete; };
  const auto continues = [this](const Run& run) { return run.complete && run.joined < frame_; };
  const auto before_count = std::exchange(participants_, std::count_if(runs_.begin(), runs_.end(), complete));
  if (std::count_if(runs_.begin(), runs_.end(), continues) == before_count) {
    return;
  }
  const auto is_absent = [&](NodeNumber node) { return node >= runs_.size() || !continues(runs_[node]); };
  const List& old = before();
  for (std::size_t i = 0; i < old.keys.size(); ++i) {
    if (is_absent(old.found[i].by)) {
      absent_.push_back(old.keys[i]);
    }
  }
  matches_.add_endings(absent_.span());
  endings_.push_back(absent_.span());
  ends_ += absent_.size();
}

// A pair that ended at one node and began at another has moved between them, and persists. The phases that are
// corrected are in memory that other cores have written.
void ContactLedger::match_borders() {
  if (!matches_.prepare()) {
    return;
  }
  for (NodeNumber node = 0; node < summaries_.size(); ++node) {
    matches_.match(node, summaries_[node].border_beginning);
  }
  matches_.finish();
  for (const BorderMatches::Match& match : matches_.matches()) {
    base::prefetch_for_write(summaries_[match.node].begun + match.position);
  }
  for (const BorderMatches::Match& match : matches_.matches()) {
    summaries_[match.node].begun[match.position] = 0;
    if (runs_[match.node].shared == nullptr) {
      runs_[match.node].corrections.push_back(match.position);
    }
  }
  began_ -= matches_.matches().size();
  ends_ -= matches_.passed().size();
}

void ContactLedger::share_out() {
  const auto shares = static_cast<std::size_t>(
      std::count_if(runs_.begin(), runs_.end(), [](const Run& run) { return run.shared != nullptr; }));
  now().grow(size_);
  *output_merge_ = {.node_contacts = node_contacts_,
                    .shares = keeps_two_ ? std::max<std::size_t>(shares, 1) : 1,
                    .server_writes = !keeps_two_,
                    .endings = endings_,
                    .passed = matches_.passed(),
                    .keys_before = before().keys.span(),
                    .contacts_before = before().contacts.data()};
  start_output();
  if (shares == 0 && keeps_two_) {
    duplicates_ = write_slice(*output_merge_, 0, scratch_);
  }
  constexpr std::size_t ahead = 8;
  std::uint32_t share = 0;
  for (std::size_t node = 0; node < runs_.size(); ++node) {
    const Run& run = runs_[node];
    if (node + ahead < runs_.size()) {
      base::prefetch_for_write(&node_contacts_[node + ahead]->output_merge);
    }
    if (run.shared != nullptr) {
      run.shared->output_merge = output_merge_.get();
      run.shared->share = share++;
      run.shared->gate.admit();
      run.shared->hand_over_gate.admit();
    }
  }
}

// The lists of this frame are still to be written.
void ContactLedger::start_output() {
  List& list = now();
  List& gone = ended();
  if (keeps_two_) {
    list.resize(size_);
    list.request_huge_pages();
  }
  gone.resize(ends_);
  output_merge_->size = size_;
  output_merge_->contacts = list.contacts.data();
  output_merge_->keys = list.keys.data();
  output_merge_->found = list.found.data();
  output_merge_->ended = gone.contacts.data();
  output_merge_->ended_keys = gone.keys.data();
  duplicates_ = 0;
}

void ContactLedger::lose(NodeNumber node) {
  any_lost_ = true;
  NodeContacts* const shared = runs_[node].shared;
  if (shared != nullptr && shared->gate.bar() && keeps_two_) {
    duplicates_ += write_slice(*output_merge_, shared->share, scratch_);
  }
}

// The node contacts stay as they are, because their threads get no other frame. The lists of the frame before may be
// read by the embedder until this frame is complete; begin() of the next frame replaces them too.
void ContactLedger::write_again() {
  Abandoned& old = abandoned_.emplace_back();
  old.output_merge = std::exchange(output_merge_, std::make_unique<OutputMerge>(*output_merge_));
  old.runs = std::exchange(runs_, std::vector<Run>(runs_.size()));
  old.node_contacts = std::exchange(node_contacts_, {});
  old.endings = std::exchange(endings_, {});
  old.absent = std::exchange(absent_, {});
  old.matches = std::exchange(matches_, {});
  old.now = std::exchange(now(), {});
  old.ended_now = std::exchange(ended(), {});
  start_output();
  for (std::size_t share = 0; share < output_merge_->shares; ++share) {
    duplicates_ += write_slice(*output_merge_, share, scratch_);
  }
  written_again_ = true;
}

bool ContactLedger::complete() {
  const auto is_inside = [](const Run& run) { return run.shared != nullptr && run.shared->gate.is_inside(); };
  if (!written_again_) {
    // A node that is done has left its gate.
    if (any_lost_ && std::any_of(runs_.begin(), runs_.end(), is_inside)) {
      return false;
    }
    constexpr std::size_t ahead = 8;
    for (std::size_t node = 0; node < node_contacts_.size(); ++node) {
      if (node + ahead < node_contacts_.size()) {
        base::prefetch_for_read(&node_contacts_[node + ahead]->report.duplicates);
      }
      duplicates_ += node_contacts_[node]->report.duplicates;  // 0 of a node that sends messages
    }
  }
  if (!keeps_two_) {
    write_over();
  }
  if (duplicates_ != 0) [[unlikely]] {
    drop_duplicates();
  }
  return true;
}

// The ended contacts are copied from the list that is then overwritten. share_out() has made room in it, so nothing is
// allocated after the contacts are sorted: until then the list of the frame before can be read.
void ContactLedger::write_over() {
  write_ended(*output_merge_, 0, scratch_);
  sort_listed(*output_merge_, 0, scratch_);
  List& list = now();
  list.resize(size_);
  list.request_huge_pages();
  duplicates_ = write_listed(*output_merge_, scratch_);
}

void ContactLedger::drop_duplicates() {
  List& list = now();
  std::size_t kept = 0;
  began_ = 0;
  for (std::size_t i = 0; i < list.keys.size(); ++i) {
    if (kept == 0 || list.keys[i] != list.keys[kept - 1]) {
      list.contacts[kept] = list.contacts[i];
      list.keys[kept] = list.keys[i];
      list.found[kept] = list.found[i];
      began_ += list.contacts[kept].phase == Phase::begin ? 1 : 0;
      ++kept;
    }
  }
  list.resize(kept);
}

std::span<const ContactNotice> ContactLedger::notices(bool all) {
  notices_.clear();
  if (!all) {
    list_user_notices();
    return notices_.span();
  }
  order_.start(node_contacts_);
  for (NodeNumber node = 0; node < node_contacts_.size(); ++node) {
    for (std::uint32_t i = 0; i < node_contacts_[node]->keys.size(); ++i) {
      order_.add(node, i);
    }
  }
  order_.sort();
  std::uint64_t last = 0;
  order_.visit([&](std::uint64_t key, NodeNumber node, std::uint32_t position, Phase) {
    if (key != last) {
      add_notice(key, node, node_contacts_[node]->found[position], position);
    }
    last = key;
  });
  return notices_.span();
}

void ContactLedger::add_notice(std::uint64_t key, NodeNumber node, const FoundContact& found, std::uint32_t position) {
  const NodeContacts& from = *node_contacts_[node];
  notices_.push_back({key, &from, nullptr, found, {found.slot_a, found.slot_b, node}, from.phase(position)});
}

// Contacts of avatars only, so few.
void ContactLedger::list_user_notices() {
  for (NodeNumber node = 0; node < node_contacts_.size(); ++node) {
    const NodeContacts& node_contacts = *node_contacts_[node];
    for (const UserContact& contact : node_contacts.user_contacts) {
      node_contacts.prefetch(contact.found);
      add_notice(contact.key, node, contact.found, contact.position);
    }
  }
  const auto by_key = [](const ContactNotice& p, const ContactNotice& q) { return p.key < q.key; };
  std::sort(notices_.begin(), notices_.end(), by_key);
  const auto same = [](const ContactNotice& p, const ContactNotice& q) { return p.key == q.key; };
  notices_.resize(static_cast<std::size_t>(std::unique(notices_.begin(), notices_.end(), same) - notices_.begin()));
}

std::span<const ContactNotice> ContactLedger::ended_notices(bool all) {
  ended_notices_.clear();
  ending_order_.clear();
  if (all) {
    for (const std::span<const std::uint64_t> endings : endings_) {
      for (const std::uint64_t key : endings) {
        ending_order_.add(key);
      }
    }
  } else {
    for (const NodeContacts* node_contacts : node_contacts_) {
      for (const UserContact& contact : node_contacts->user_contacts_ending) {
        ending_order_.add(contact.key);
      }
    }
    for (const std::uint64_t key : absent_) {
      ending_order_.add(key);
    }
  }
  ending_order_.sort();
  std::size_t old = 0;
  for (std::size_t i = 0; i < ending_order_.size(); ++i) {
    const std::uint64_t key = ending_order_.key_at(i);
    if (!std::binary_search(matches_.passed().begin(), matches_.passed().end(), key)) {
      list_ended_notice(key, old);
    }
  }
  return ended_notices_.span();
}

void ContactLedger::list_ended_notice(std::uint64_t key, std::size_t& old) {
  const auto& keys = before().keys;
  const auto* const at = search_from(keys.begin() + old, keys.end(), key);
  old = static_cast<std::size_t>(at - keys.begin());
  ended_notices_.push_back({key, nullptr, &before().contacts[old], {}, before().found[old], Phase::end});
}

}  // namespace ringfence::nodes
