#include "nodes/server/objects/object_table.hpp"

#include <algorithm>

namespace ringfence::nodes {

ObjectTable::ObjectTable(std::size_t objects, std::size_t state_bytes) : state_bytes_(state_bytes), index_(objects) {
  each_list([&](auto& list) { list.reserve(objects); });
  states_.reserve(objects * state_bytes);
  groups_.reserve(objects);
  crowds_.reserve(objects);
  free_.reserve(objects);
  ended_.reserve(objects);
  moved_.reserve(objects);
  unnotified_.reserve(objects);
}

// Calls visit for each list that has an element for each slot.
template <class Visit>
void ObjectTable::each_list(Visit visit) {
  visit(rows_), visit(changed_), visit(origins_), visit(numbers_), visit(layers_), visit(marks_), visit(hosts_);
  visit(notified_cells_), visit(bounds_), visit(present_), visit(resting_);
}

messages::HandOverRecord ObjectTable::hand_over(std::uint32_t slot) const noexcept {
  const ObjectRow& row = rows_[slot];
  return {row.object, row.pose, origins_[slot].user_data, row.shape, row.layer, row.category, group(slot), 0};
}

std::uint32_t ObjectTable::find(const messages::ObjectRef& object) const noexcept {
  if (object.slot >= rows_.size()) {
    return base::NumberIndex::none;
  }
  const ObjectRow& row = rows_[object.slot];
  const bool same =
      alive(object.slot) && row.object.number == object.number && row.object.generation == object.generation;
  return same ? object.slot : base::NumberIndex::none;
}

std::uint32_t ObjectTable::add(ObjectId id, const ObjectSpec& spec) {
  std::uint32_t slot;
  if (free_.empty()) {
    slot = static_cast<std::uint32_t>(rows_.size());
    each_list([](auto& list) { list.push_back({}); });
    groups_.resize(has_groups_ ? slots() : 0);
    crowds_.resize(has_crowds_ ? slots() : 0);
    notified_bounds_.resize(keeps_notified_bounds_ ? slots() : 0);
    states_.resize(states_.size() + state_bytes_);
  } else {
    slot = free_.back();
    free_.pop_back();
  }
  std::fill_n(new_state(slot), state_bytes_, std::byte{0});
  ObjectRow& row = change_row(slot);
  row.object = {slot, id.generation(), id.number(), spec.enabled ? messages::flag_present : 0u};
  row.pose = spec.pose;
  row.shape = spec.shape.number();
  row.category = static_cast<std::uint16_t>(spec.category);
  set_layer(slot, spec.layer);
  set_group(slot, spec.group);
  set_crowd(slot, 0);
  origins_[slot] = {spec.user_data, spec.user.number()};
  numbers_[slot] = id.number();
  marks_[slot] = static_cast<ObjectMarks>(alive_mark | (spec.category == Category::avatar ? avatar_mark : 0));
  hosts_[slot] = messages::Endpoint::none();
  index_.set(id.number(), slot);
  mark_moved(slot);
  return slot;
}

void ObjectTable::set_group(std::uint32_t slot, std::uint32_t group) {
  if (group != 0 && !has_groups_) {
    groups_.resize(slots());
    has_groups_ = true;
  }
  if (has_groups_) {
    groups_[slot] = group;
    changed_[slot] = frame_;
  }
}

void ObjectTable::set_crowd(std::uint32_t slot, std::uint32_t crowd) {
  if (crowd != 0 && !has_crowds_) {
    crowds_.resize(slots());
    has_crowds_ = true;
  }
  if (has_crowds_) {
    crowds_[slot] = crowd;
  }
}

void ObjectTable::keep_notified_bounds() {
  if (!keeps_notified_bounds_) {
    notified_bounds_.resize(slots());
    std::copy(bounds_.begin(), bounds_.end(), notified_bounds_.begin());
    keeps_notified_bounds_ = true;
  }
}

void ObjectTable::set_layer(std::uint32_t slot, std::uint8_t layer) noexcept {
  ObjectRow& row = change_row(slot);
  row.layer = layer;
  const bool fixed = row.category == static_cast<std::uint16_t>(Category::fixed);
  layers_[slot] = static_cast<std::uint8_t>(layer | (fixed ? broad_phase::fixed_object : std::uint8_t{0}));
}

void ObjectTable::end(std::uint32_t slot) {
  ObjectRow& row = change_row(slot);
  marks_[slot] &= static_cast<ObjectMarks>(~alive_mark);
  row.object.flags = 0;
  index_.erase(row.object.number);
  ended_.push_back(slot);
  mark_moved(slot);
}

void ObjectTable::settle() {
  // An object that moved rests from the next frame on, unless mark_moved() clears the byte again.
  for (const std::uint32_t slot : moved_) {
    marks_[slot] &= static_cast<ObjectMarks>(~(moved_mark | reported_mark | inner_mark));
    resting_[slot] = 1;
  }
  moved_.clear();
  unnotified_.clear();
  free_.insert(free_.end(), ended_.begin(), ended_.end());
  ended_.clear();
}

void ObjectTable::mark_moved(std::uint32_t slot) {
  if ((marks_[slot] & moved_mark) == 0) {
    unnotified_.push_back(slot);
  }
  mark_moved_host_only(slot);
}

void ObjectTable::note_notified(std::uint32_t slot, const geometry::Bounds& bounds, const regions::CellGrid& grid,
                                bool shared) {
  const bool present = (rows_[slot].object.flags & messages::flag_present) != 0;
  const ObjectMarks marks = marks_[slot] & static_cast<ObjectMarks>(~(notified_mark | shared_mark));
  marks_[slot] = static_cast<ObjectMarks>(marks | (present ? notified_mark : 0) | (shared ? shared_mark : 0));
  notified_cells_[slot] = grid.cells_of(bounds);
  bounds_[slot] = bounds;
  if (keeps_notified_bounds_) {
    notified_bounds_[slot] = bounds;
  }
}

void ObjectTable::order_moved() {
  if (moved_.size() * 8 < slots()) {
    return;
  }
  moved_.clear();
  for (std::uint32_t slot = 0; slot < slots(); ++slot) {
    if ((marks_[slot] & moved_mark) != 0) {
      moved_.push_back(slot);
    }
  }
  unnotified_.resize(moved_.size());
  std::copy(moved_.begin(), moved_.end(), unnotified_.begin());
}

// In runs of slots, because only whole pages are freed.
void ObjectTable::release_states_of_nodes() noexcept {
  const auto count = static_cast<std::uint32_t>(slots());
  for (std::uint32_t end = 0; end < count; ++end) {
    const std::uint32_t first = end;
    for (; end < count && hosts_[end].is_node(); ++end) {
      marks_[end] |= no_state_mark;
    }
    states_.release_pages(first * state_bytes_, end * state_bytes_);
  }
  moved_.release_unused_pages();
  unnotified_.release_unused_pages();
}

}  // namespace ringfence::nodes
