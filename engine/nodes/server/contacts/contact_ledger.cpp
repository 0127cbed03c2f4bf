#include "nodes/server/contacts/contact_ledger.hpp"

#include <algorithm>
#include <utility>

#include "base/prefetch.hpp"

namespace ringfence::nodes {

ContactLedger::ContactLedger(std::size_t nodes, std::size_t contacts, std::uint32_t deepest_contacts,
                             std::size_t frames)
    : runs_(nodes), deepest_contacts_(deepest_contacts), keeps_two_(frames == 2) {
  notices_.reserve(contacts);
  scratch_.reserve(contacts);
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
  for (ContactRun& run : runs_) {
    run.join(frame);
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
    runs_[node].begin(frame);
    node_contacts_[node] = &runs_[node].node_contacts();
    summaries_[node] = {};
  }
  if (keeps_two_) {
    now().resize(0);
  }
  ended().resize(0);
}

bool ContactLedger::receive(NodeNumber node, const messages::CollisionRecord& record, const ContactObjects& objects) {
  return runs_[node].add(record, objects);
}

bool ContactLedger::receive(NodeNumber node, const messages::ChangeRecord& record) {
  return runs_[node].add(record, before().keys.span());
}

void ContactLedger::end_run(NodeNumber node, const ContactObjects& objects) {
  ContactRun& run = runs_[node];
  run.end(objects, before().found.span());
  take(node, run.node_contacts());
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
    runs_[node].unlist(deepest_.unlisted(node));
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
  const auto complete = [](const ContactRun& run) { return run.is_complete(); };
  const auto continues = [this](const ContactRun& run) { return run.continues(frame_); };
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
    if (runs_[match.node].shared() == nullptr) {
      runs_[match.node].correct(match.position);
    }
  }
  began_ -= matches_.matches().size();
  ends_ -= matches_.passed().size();
}

void ContactLedger::share_out() {
  const auto shares = static_cast<std::size_t>(
      std::count_if(runs_.begin(), runs_.end(), [](const ContactRun& run) { return run.shared() != nullptr; }));
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
    if (node + ahead < runs_.size()) {
      base::prefetch_for_write(&node_contacts_[node + ahead]->output_merge);
    }
    if (NodeContacts* const shared = runs_[node].shared()) {
      shared->output_merge = output_merge_.get();
      shared->share = share++;
      shared->gate.admit();
      shared->hand_over_gate.admit();
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
  NodeContacts* const shared = runs_[node].shared();
  if (shared != nullptr && shared->gate.bar() && keeps_two_) {
    duplicates_ += write_slice(*output_merge_, shared->share, scratch_);
  }
}

// The node contacts stay as they are, because their threads get no other frame. The lists of the frame before may be
// read by the embedder until this frame is complete; begin() of the next frame replaces them too.
void ContactLedger::write_again() {
  Abandoned& old = abandoned_.emplace_back();
  old.output_merge = std::exchange(output_merge_, std::make_unique<OutputMerge>(*output_merge_));
  old.runs = std::exchange(runs_, std::vector<ContactRun>(runs_.size()));
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
  const auto is_inside = [](const ContactRun& run) {
    return run.shared() != nullptr && run.shared()->gate.is_inside();
  };
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
  return all ? notices_.list_all(node_contacts_) : notices_.list_of_users(node_contacts_);
}

std::span<const ContactNotice> ContactLedger::ended_notices(bool all) {
  const List& list = before();
  const ContactNotices::Before old{list.keys.span(), list.contacts.span(), list.found.span(), matches_.passed()};
  return all ? notices_.list_all_ended(endings_, old)
             : notices_.list_ended_of_users(node_contacts_, absent_.span(), old);
}

}  // namespace ringfence::nodes
