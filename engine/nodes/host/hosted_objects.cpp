#include "nodes/host/hosted_objects.hpp"

#include <algorithm>

namespace ringfence::nodes {

using messages::flag_host_owned;
using messages::flag_present;

HostedObjects::HostedObjects(std::size_t objects, std::size_t state_bytes)
    : state_bytes_(state_bytes), index_(objects) {
  states_.reserve(objects * state_bytes_);
  each_list([&](auto& list) { list.reserve(objects); });
}

// Calls visit for each list that has an element for each object.
template <class Visit>
void HostedObjects::each_list(Visit visit) {
  visit(hosted_), visit(numbers_), visit(touched_), visit(places_in_list_);
  if (!groups_.empty()) {
    visit(groups_);
  }
}

// Of the last object.
void HostedObjects::add_group(std::uint32_t group) {
  if (group == 0 && groups_.empty()) {
    return;
  }
  if (groups_.empty()) {
    groups_.resize(hosted_.size() - 1);
    std::fill(groups_.begin(), groups_.end(), 0u);
  }
  groups_.push_back(group);
}

void HostedObjects::adopt(const messages::HandOverRecord& record, const std::byte* state) {
  drop(record.object.number);
  index_.set(record.object.number, static_cast<std::uint32_t>(hosted_.size()));
  hosted_.push_back({record.object, record.pose, record.user_data, record.shape, record.layer, record.category});
  hosted_.back().object.flags &= flag_present | flag_host_owned;
  numbers_.push_back(record.object.number);
  states_.resize(states_.size() + state_bytes_);
  std::copy_n(state, state_bytes_, states_.end() - state_bytes_);
  touched_.push_back(0);
  places_in_list_.push_back(base::NumberIndex::none);
  add_group(record.group);
}

void HostedObjects::drop(ObjectNumber number) {
  const std::uint32_t i = index_.find(number);
  if (i == base::NumberIndex::none) {
    return;
  }
  index_.erase(number);
  const std::size_t last = hosted_.size() - 1;
  if (i != last) {
    index_.set(numbers_[last], i);
    std::copy_n(state(last), state_bytes_, states_.data() + i * state_bytes_);
  }
  each_list([&](auto& list) {
    list[i] = list[last];
    list.pop_back();
  });
  states_.resize(last * state_bytes_);
}

void HostedObjects::prefetch_leaver(ObjectNumber number) const noexcept {
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
  base::prefetch_for_write(&places_in_list_[i]);
  base::prefetch_for_write(&numbers_[i]);
  base::prefetch_for_write(&touched_[i]);
}

messages::HandOverRecord HostedObjects::hand_over(std::size_t i) const noexcept {
  const Hosted& hosted = hosted_[i];
  messages::ObjectRef object = hosted.object;
  object.flags &= flag_present | flag_host_owned;
  return {object, hosted.pose, hosted.user_data, hosted.shape, hosted.layer, hosted.category, group(i), 0};
}

bool HostedObjects::place(ObjectNumber number, const Pose& pose, bool present) {
  const std::uint32_t i = index_.find(number);
  if (i == base::NumberIndex::none) {
    return false;
  }
  hosted_[i].pose = pose;
  hosted_[i].object.flags = (present ? flag_present : 0u) | messages::flag_placed;
  touched_[i] = 1;
  return true;
}

void HostedObjects::adopt(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    adopt(message.record<messages::HandOverRecord>(i), message.state<messages::HandOverRecord>(i));
  }
}

bool HostedObjects::apply(const messages::MessageView& message) {
  switch (message.type()) {
    case messages::MessageType::adopt:
      for (std::size_t i = 0; i < message.count(); ++i) {
        const auto record = message.record<messages::HandOverRecord>(i);
        adopt(record, message.state<messages::HandOverRecord>(i));
        hosted_.back().object.flags |= messages::flag_adopted;
      }
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

}  // namespace ringfence::nodes
