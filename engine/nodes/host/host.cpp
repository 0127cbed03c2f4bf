#include "nodes/host/host.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>

#include "base/pair_sort.hpp"
#include "base/prefetch.hpp"

namespace ringfence::nodes {

using messages::flag_host_owned;
using messages::flag_present;

Host::Host(const MotionModel* model, std::size_t objects, FaultPoint* fault)
    : model_(model),
      fault_(fault),
      state_bytes_(model == nullptr ? 0 : (model->state_bytes() + 7) / 8 * 8),
      uses_contacts_(model != nullptr && model->uses_contacts()),
      index_(objects) {
  hosted_.reserve(objects);
  numbers_.reserve(objects);
  states_.reserve(objects * state_bytes_);
  touched_.reserve(objects);
  cells_.reserve(objects);
  places_in_list_.reserve(objects);
  groups_.reserve(objects);
  changed_.reserve(objects);
  differs_.reserve(objects);
  contact_begin_.reserve(objects + 2);
  steered_.reserve(64);
  scratch_.resize(batch * state_bytes_);
}

void Host::adopt(const messages::HandOverRecord& record, const std::byte* state) {
  drop(record.object.number);
  index_.set(record.object.number, static_cast<std::uint32_t>(hosted_.size()));
  hosted_.push_back({record.object, record.pose, record.user_data, record.shape, record.layer, record.category});
  hosted_.back().object.flags &= flag_present | flag_host_owned;
  numbers_.push_back(record.object.number);
  states_.resize(states_.size() + state_bytes_);
  std::copy_n(state, state_bytes_, states_.end() - state_bytes_);
  touched_.push_back(0);
  cells_.push_back(unplaced);
  places_in_list_.push_back(base::NumberIndex::none);
  groups_.push_back(record.group);
}

void Host::drop(ObjectNumber number) {
  const std::uint32_t i = index_.find(number);
  if (i == base::NumberIndex::none) {
    return;
  }
  index_.erase(number);
  const std::size_t last = hosted_.size() - 1;
  if (i != last) {
    hosted_[i] = hosted_[last];
    numbers_[i] = numbers_[last];
    touched_[i] = touched_[last];
    cells_[i] = cells_[last];
    places_in_list_[i] = places_in_list_[last];
    groups_[i] = groups_[last];
    std::copy_n(states_.data() + last * state_bytes_, state_bytes_, states_.data() + i * state_bytes_);
    index_.set(hosted_[i].object.number, i);
  }
  hosted_.pop_back();
  numbers_.pop_back();
  touched_.pop_back();
  cells_.pop_back();
  places_in_list_.pop_back();
  groups_.pop_back();
  states_.resize(last * state_bytes_);
}

void Host::prefetch_leaver(ObjectNumber number) const noexcept {
  const std::uint32_t i = index_.find(number);
  if (i == base::NumberIndex::none) {
    return;
  }
  base::prefetch_for_write(&hosted_[i]);
  base::prefetch_for_write(reinterpret_cast<const std::byte*>(&hosted_[i] + 1) - 1);
  if (state_bytes_ != 0) {
    base::prefetch_for_write(state(i));
    base::prefetch_for_write(state(i + 1) - 1);
  }
  base::prefetch_for_write(&cells_[i]);
  base::prefetch_for_write(&places_in_list_[i]);
  base::prefetch_for_write(&numbers_[i]);
  base::prefetch_for_write(&touched_[i]);
}

messages::HandOverRecord Host::hand_over(std::size_t i) const noexcept {
  const Hosted& hosted = hosted_[i];
  return {hosted.object, hosted.pose, hosted.user_data, hosted.shape, hosted.layer, hosted.category, groups_[i], 0};
}

bool Host::place(ObjectNumber number, const Pose& pose, bool present) {
  const std::uint32_t i = index_.find(number);
  if (i == base::NumberIndex::none) {
    return false;
  }
  hosted_[i].pose = pose;
  hosted_[i].object.flags = present ? flag_present : 0u;
  touched_[i] = 1;
  return true;
}

void Host::adopt(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    adopt(message.record<messages::HandOverRecord>(i), message.state<messages::HandOverRecord>(i));
  }
}

bool Host::apply(const messages::MessageView& message) {
  switch (message.type()) {
    case messages::MessageType::adopt:
      adopt(message);
      return true;
    case messages::MessageType::drop:
      for (std::size_t i = 0; i < message.count(); ++i) {
        drop(message.record<messages::DropRecord>(i).object.number);
      }
      return true;
    case messages::MessageType::place:
      for (std::size_t i = 0; i < message.count(); ++i) {
        const auto record = message.record<messages::PlaceRecord>(i);
        place(record.object.number, record.pose, (record.object.flags & messages::flag_present) != 0);
      }
      return true;
    default:
      return false;
  }
}

void Host::add_contacts(std::uint64_t frame, const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    add_contact(frame, message.record<Contact>(i));
  }
}

void Host::add_late_contacts(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    add_late_contact(message.record<Contact>(i));
  }
}

void Host::steer(ObjectNumber number, const Pose& pose) { steered_.push_back({number, pose}); }

void Host::ContactList::add(const Contact& contact) {
  contacts.push_back(contact);
  keys.push_back(contact.phase == Phase::end ? 0 : base::PairSort::key(contact.a, contact.b));
}

void Host::ContactList::clear() noexcept {
  contacts.clear();
  keys.clear();
  own_order.clear();
  own = 0;
}

Contact& Host::add_own_contact(std::uint64_t frame) {
  ContactList& list = lists_[frame & 1];
  ++list.own;
  Contact& contact = list.contacts.add();
  // The lists of two frames alternate, so these lines are not in the cache.
  constexpr std::ptrdiff_t lines_ahead = 1024;
  base::prefetch_for_write(reinterpret_cast<const std::byte*>(&contact) + lines_ahead);
  base::prefetch_for_write(reinterpret_cast<const std::byte*>(&contact) + lines_ahead + 64);
  contact.phase = Phase::persist;  // true of 95 %; confirm_begin() corrects the others
  return contact;
}

void Host::reserve_contacts(std::size_t contacts) {
  for (ContactList& list : lists_) {
    list.contacts.reserve(contacts);
    list.keys.reserve(contacts);
    list.own_order.reserve(contacts);
  }
  hosted_contacts_.reserve(contacts);
  contact_order_.reserve(2 * contacts);
}

// Adds the late contacts to those of the frame. They are rare (the host of an object has changed at the cut), so all
// contacts are simply sorted again.
Host::KnownContacts Host::gather_contacts(std::uint64_t frame) {
  if (!given_.contacts.empty()) {
    return std::exchange(given_, {});
  }
  const ContactList& known = lists_[(frame - 1) & 1];
  if (late_.contacts.empty()) {
    return {known.contacts.span(), known.keys.span(), known.own_order.span()};
  }
  auto& all = late_.contacts;
  for (const Contact& contact : known.contacts) {
    all.push_back(contact);
  }
  const auto key = [](const Contact& contact) { return base::PairSort::key(contact.a, contact.b); };
  std::sort(all.begin(), all.end(), [&](const Contact& p, const Contact& q) { return key(p) < key(q); });
  const auto same = [&](const Contact& p, const Contact& q) { return key(p) == key(q); };
  all.resize(static_cast<std::size_t>(std::unique(all.begin(), all.end(), same) - all.begin()));
  late_.keys.clear();
  for (const Contact& contact : all) {
    late_.keys.push_back(contact.phase == Phase::end ? 0 : key(contact));
  }
  return {late_.contacts.span(), late_.keys.span(), {}};
}

// Merges own and received contacts in order of (a, b), and drops those without a hosted object. Most are own contacts,
// so an inner loop handles the own contacts before the next received one.
void Host::find_hosted(const KnownContacts& known) {
  const std::uint64_t* const keys = known.keys.data();
  const std::size_t own_end = known.own_order.size();
  const std::size_t end = known.keys.size();
  hosted_contacts_.resize(end);
  HostedContact* out = hosted_contacts_.data();
  const auto add = [&](std::uint64_t key, const HostedContact& was) {
    const std::uint32_t a = find(static_cast<ObjectNumber>(key >> 32), was.a);
    const std::uint32_t b = find(static_cast<ObjectNumber>(key), was.b);
    *out = {was.contact, a, b};
    out += (a & b) != base::NumberIndex::none ? 1 : 0;
  };
  const auto prefetch = [&](std::size_t i, const HostedContact& was) {
    prefetch_number(static_cast<ObjectNumber>(keys[i] >> 32), was.a);
    prefetch_number(static_cast<ObjectNumber>(keys[i]), was.b);
  };
  constexpr HostedContact nothing_known{0, base::NumberIndex::none, base::NumberIndex::none};
  constexpr std::size_t ahead = 16;
  constexpr std::size_t received_ahead = 4;  // there are usually many own contacts between two received ones
  std::size_t own = 0;
  for (std::size_t received = own_end; received <= end; ++received) {
    if (received + received_ahead < end) {
      prefetch(received + received_ahead, nothing_known);
    }
    if (received < end && keys[received] == 0) {
      continue;  // an ended contact
    }
    const std::uint64_t until = received < end ? keys[received] : ~std::uint64_t{0};
    for (; own < own_end && keys[own] < until; ++own) {
      if (own + ahead < own_end) {
        prefetch(own + ahead, known.own_order[own + ahead]);
      }
      add(keys[own], known.own_order[own]);
    }
    if (received < end) {
      add(keys[received], {static_cast<std::uint32_t>(received), base::NumberIndex::none, base::NumberIndex::none});
    }
  }
  hosted_contacts_.resize(static_cast<std::size_t>(out - hosted_contacts_.data()));
}

// Stable counting sort of the contacts by hosted object; the contacts of one object stay in order of (a, b). Objects
// that are not hosted are counted in an extra first entry: none + 1 is 0.
void Host::sort_contacts(const KnownContacts& known) {
  static_assert(base::NumberIndex::none + 1 == 0);
  const std::size_t objects = hosted_.size();
  find_hosted(known);
  contact_begin_.assign(objects + 2, 0);
  std::uint32_t* const next = contact_begin_.data() + 1;
  for (const HostedContact& hosted : hosted_contacts_) {
    ++next[hosted.a + 1];
    ++next[hosted.b + 1];
  }
  next[0] = 0;
  for (std::size_t i = 0; i < objects; ++i) {
    next[i + 1] += next[i];
  }
  contact_order_.resize(next[objects]);
  // Each put() advances the begin of an object, in the end to the begin of the next object. So each begin was stored
  // one entry too far.
  const auto put = [&](std::uint32_t i, std::uint32_t contact) {
    if (i != base::NumberIndex::none) {
      contact_order_[next[i]++] = contact;
    }
  };
  for (const HostedContact& hosted : hosted_contacts_) {
    put(hosted.a, hosted.contact);
    put(hosted.b, hosted.contact);
  }
  known_contacts_ = known.contacts.data();
}

void Host::move(std::uint64_t frame) {
  begin_move(frame);
  move_batches(0, hosted_.size());
  for (const Steered& steered : steered_) {
    const std::uint32_t i = index_.find(steered.number);
    if (i != base::NumberIndex::none) {
      hosted_[i].pose = steered.pose;
      hosted_[i].object.flags = flag_present;
      touched_[i] = 1;
    }
  }
  steered_.clear();
  end_move();
  collect_changed(0, hosted_.size());
}

void Host::begin_move(std::uint64_t frame) {
  frame_ = frame;
  next_moved_ = 0;
  changed_.clear();
  refusals_ = {};
  list_all_ = std::exchange(list_all_next_, false);
  if (uses_contacts_ && !hosted_.empty()) {
    sort_contacts(gather_contacts(frame));
  }
  if (!frame_inputs_.empty()) {
    frame_inputs_.find_objects(index_);
  }
}

void Host::end_move() noexcept {
  late_.clear();
  frame_inputs_.clear();
}

bool Host::move_next() {
  assert(steered_.empty());
  changed_.clear();
  if (next_moved_ == hosted_.size()) {
    end_move();
    return false;
  }
  const std::size_t end = std::min(next_moved_ + batch, hosted_.size());
  move_batches(next_moved_, end);
  collect_changed(next_moved_, end);
  next_moved_ = end;
  return true;
}

void Host::move_batches(std::size_t first, std::size_t end) {
  if (model_ == nullptr) {
    return;
  }
  for (std::size_t at = first; at < end; at += batch) {
    move_batch(at, std::min(batch, end - at));
  }
}

void Host::collect_changed(std::size_t first, std::size_t end) {
  changed_.resize(end - first);
  differs_.resize(end - first);
  std::size_t changed = 0;
  for (std::size_t i = first; i < end; ++i) {
    std::uint32_t& flags = hosted_[i].object.flags;
    flags &= flag_present | flag_host_owned;
    changed_[changed] = static_cast<std::uint32_t>(i);
    differs_[changed] = touched_[i];
    changed += list_all_ ? 1 : touched_[i] | (flags / flag_host_owned);
  }
  std::fill(touched_.begin() + static_cast<std::ptrdiff_t>(first), touched_.begin() + static_cast<std::ptrdiff_t>(end),
            std::uint8_t{0});
  changed_.resize(changed);
  differs_.resize(changed);
}

void Host::move_batch(std::size_t first, std::size_t count) {
  if (call_model(first, count)) {
    accept(first, count);
    return;
  }
  // The model threw somewhere in the batch. It is pure, so each object is tried alone, and only those for which it
  // throws do not move.
  for (std::size_t i = 0; i < count; ++i) {
    if (call_model(first + i, 1)) {
      accept(first + i, 1);
    } else {
      ++refusals_.model_failed;
    }
  }
}

// Objects do not stay in the cache from frame to frame, and the contacts of an object are scattered. Only the geometry
// of a contact is prefetched.
void Host::prefetch(std::size_t i) const noexcept {
  if (i >= hosted_.size()) {
    return;
  }
  base::prefetch_for_write(&hosted_[i]);
  if (state_bytes_ != 0) {
    base::prefetch_for_write(state(i));
  }
  for (const std::uint32_t c : contacts_of(i)) {
    const auto* contact = reinterpret_cast<const std::byte*>(&known_contacts_[c]);
    base::prefetch_for_read(contact);
    base::prefetch_for_read(contact + offsetof(Contact, generation_a) - 1);
  }
}

// The contacts of hosted object i, as indices into known_contacts_.
std::span<const std::uint32_t> Host::contacts_of(std::size_t i) const noexcept {
  if (!uses_contacts_) {
    return {};
  }
  return {contact_order_.data() + contact_begin_[i], contact_begin_[i + 1] - contact_begin_[i]};
}

bool Host::call_model(std::size_t first, std::size_t count) {
  if (state_bytes_ != 0) {
    std::memcpy(scratch_.data(), state(first), count * state_bytes_);
  }
  for (std::size_t i = 0; i < count; ++i) {
    prefetch(first + batch + i);
    const Hosted& hosted = hosted_[first + i];
    const bool present = (hosted.object.flags & flag_present) != 0;
    inputs_[i] = {hosted.object.number,
                  ShapeId(hosted.shape),
                  static_cast<Category>(hosted.category),
                  present,
                  hosted.user_data,
                  hosted.pose,
                  state(first + i),
                  ObjectContacts(known_contacts_, contacts_of(first + i)),
                  {}};
    outputs_[i] = {hosted.pose, present, scratch_.data() + i * state_bytes_, false};
  }
  if (!frame_inputs_.empty()) {
    frame_inputs_.set(first, std::span(inputs_, count));
  }
  if (fault_ != nullptr) {
    fault_->pass(NodeStage::model, frame_);
  }
  try {
    model_->move(frame_, std::span<const MotionInput>(inputs_, count), std::span<MotionOutput>(outputs_, count));
  } catch (...) {
    return false;
  }
  return true;
}

// Takes over the states in scratch_, except those of objects whose output is refused.
void Host::accept(std::size_t first, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    std::byte* const next = scratch_.data() + i * state_bytes_;
    if (!accept(first + i, outputs_[i], next) && state_bytes_ != 0) {
      std::memcpy(next, state(first + i), state_bytes_);
    }
  }
  if (state_bytes_ != 0) {
    std::memcpy(states_.data() + first * state_bytes_, scratch_.data(), count * state_bytes_);
  }
}

bool Host::accept(std::size_t i, const MotionOutput& output, const std::byte* next) {
  Hosted& hosted = hosted_[i];
  const std::uint32_t flags = (output.enabled ? flag_present : 0u) | (hosted.object.flags & flag_host_owned);
  const bool moved = !(output.pose == hosted.pose);  // a pose with NaN counts as moved and is refused
  if (moved) {
    Pose pose = output.pose;
    const Status status = make_valid(pose);
    if (status != Status::ok) {
      ++(status == Status::not_finite ? refusals_.not_finite : refusals_.not_unit);
      return false;
    }
    hosted.pose = pose;
  }
  if (moved || flags != hosted.object.flags || (state_bytes_ != 0 && std::memcmp(state(i), next, state_bytes_) != 0)) {
    touched_[i] = 1;
  }
  hosted.object.flags = flags;
  return true;
}

Status make_valid(Pose& pose) noexcept {
  const Vec3d& p = pose.position;
  Quat& q = pose.orientation;
  const auto near = [](double x) { return std::abs(x) <= farthest_coordinate; };  // false for NaN
  const bool finite = near(p.x) && near(p.y) && near(p.z) && std::isfinite(q.x) && std::isfinite(q.y) &&
                      std::isfinite(q.z) && std::isfinite(q.w);
  if (!finite) {
    return Status::not_finite;
  }
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  const double square = x * x + y * y + z * z + w * w;
  const double off = std::abs(square - 1.0);
  if (!(off <= 2.001e-3)) {
    return Status::not_unit;
  }
  // The squared norm of a unit quaternion rounded to four floats is within 2.4e-7 of 1, so such a quaternion is not
  // changed.
  if (off > 1e-6) {
    const double length = std::sqrt(square);
    q = {static_cast<float>(x / length), static_cast<float>(y / length), static_cast<float>(z / length),
         static_cast<float>(w / length)};
  }
  return Status::ok;
}

}  // namespace ringfence::nodes
