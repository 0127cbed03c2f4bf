#include "nodes/server/contacts/contact_run.hpp"

#include <algorithm>
#include <utility>

#include "base/pair_sort.hpp"
#include "base/prefetch.hpp"
#include "nodes/server/contacts/search_from.hpp"

namespace ringfence::nodes {
namespace {

/// Whether one of the two objects is an avatar.
bool has_avatar(const ContactObjects& objects, std::uint32_t a, std::uint32_t b) noexcept {
  return ((objects.marks[a] | objects.marks[b]) & avatar_mark) != 0;
}

}  // namespace

void ContactRun::begin(std::uint64_t frame) {
  is_complete_ = false;
  // A run whose contacts were shared has none of its own.
  if (std::exchange(shared_, nullptr) != nullptr) {
    return;
  }
  own_->start(frame);
  touches_.clear();
  ended_at_.clear();
  corrections_.clear();
}

bool ContactRun::add(const messages::CollisionRecord& record, const ContactObjects& objects) {
  if (record.slot_a >= objects.numbers.size() || record.slot_b >= objects.numbers.size()) {
    return false;
  }
  const ObjectNumber a = objects.numbers[record.slot_a];
  const ObjectNumber b = objects.numbers[record.slot_b];
  const std::uint64_t key = base::PairSort::key(a, b);
  auto& keys = own_->keys;
  if (a >= b || (keys.size() != 0 && key < keys[keys.size() - 1])) {
    return false;
  }
  const auto position = static_cast<std::uint32_t>(keys.size());
  const FoundContact found{record.slot_a, record.slot_b, 0, 0, position};
  if (has_avatar(objects, record.slot_a, record.slot_b)) {
    own_->user_contacts.push_back({key, position, found});
  }
  keys.push_back(key);
  own_->found.push_back(found);
  touches_.push_back({0, record.depth, record.normal, record.point});
  own_->rows = objects.rows.data();
  own_->origins = objects.origins.data();
  return true;
}

bool ContactRun::add(const messages::ChangeRecord& record, std::span<const std::uint64_t> keys_before) {
  const bool has_ended = (record.flags & messages::change_ended) != 0;
  return has_ended ? add_ending(record, keys_before) : add_beginning(record);
}

bool ContactRun::add_ending(const messages::ChangeRecord& record, std::span<const std::uint64_t> keys_before) {
  const bool ordered = own_->ending.empty() || own_->ending.back() <= record.key;
  const std::uint64_t* const keys = keys_before.data();
  const std::uint64_t* const end = keys + keys_before.size();
  const std::size_t last = ended_at_.empty() ? 0 : ended_at_.back();
  const std::uint64_t* const found = ordered ? search_from(keys + last, end, record.key) : end;
  if (found == end || *found != record.key) {
    return false;
  }
  ended_at_.push_back(static_cast<std::uint32_t>(found - keys));
  own_->ending.push_back(record.key);
  if ((record.flags & messages::change_at_border) != 0) {
    own_->border_ending.push_back(record.key);
  }
  return true;
}

bool ContactRun::add_beginning(const messages::ChangeRecord& record) {
  const bool ordered = own_->beginning.empty() || own_->beginning.back() < record.position;
  if (!ordered || record.position >= own_->keys.size() || own_->keys[record.position] != record.key) {
    return false;
  }
  own_->beginning.push_back(record.position);
  if ((record.flags & messages::change_at_border) != 0) {
    own_->border_beginning.push_back({record.key, record.position});
  }
  return true;
}

void ContactRun::end(const ContactObjects& objects, std::span<const Found> found_before) {
  constexpr std::size_t ahead = 8;
  for (std::size_t i = 0; i < ended_at_.size(); ++i) {
    if (i + ahead < ended_at_.size()) {
      base::prefetch_for_read(&found_before[ended_at_[i + ahead]]);
    }
    const Found& found = found_before[ended_at_[i]];
    if (has_avatar(objects, found.a, found.b)) {
      own_->user_contacts_ending.push_back({own_->ending[i], 0, {found.a, found.b}});
    }
  }
  is_complete_ = true;
  own_->touches = touches_.data();
  own_->begun.resize(own_->keys.size());
  std::fill(own_->begun.begin(), own_->begun.end(), std::uint8_t{0});
  for (const std::uint32_t position : own_->beginning) {
    own_->begun[position] = 1;
  }
  own_->summarize();
}

void ContactRun::unlist(std::span<const std::uint32_t> positions) {
  unlisted_.clear();
  for (std::size_t i = 0; shared_ == nullptr && i < positions.size(); ++i) {
    const FoundContact& found = own_->found[positions[i]];
    unlisted_.push_back({own_->keys[positions[i]], found.slot_a, found.slot_b});
  }
  node_contacts().unlist(positions);
}

}  // namespace ringfence::nodes
