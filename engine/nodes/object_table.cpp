#include "nodes/object_table.hpp"

#include <algorithm>

namespace ringfence::nodes {

ObjectTable::ObjectTable(std::size_t objects, std::size_t state_bytes) : state_bytes_(state_bytes), index_(objects) {
  rows_.reserve(objects);
  bounds_.reserve(objects);
  present_.reserve(objects);
  resting_.reserve(objects);
  layers_.reserve(objects);
  states_.reserve(objects * state_bytes);
  free_.reserve(objects);
  ended_.reserve(objects);
  moved_.reserve(objects);
}

std::uint32_t ObjectTable::find(const messages::ObjectRef& object) const noexcept {
  if (object.slot >= rows_.size()) {
    return NumberIndex::none;
  }
  const ObjectRow& row = rows_[object.slot];
  const bool same = row.alive && row.object.number == object.number && row.object.generation == object.generation;
  return same ? object.slot : NumberIndex::none;
}

std::uint32_t ObjectTable::add(ObjectId id, const ObjectSpec& spec) {
  std::uint32_t slot;
  if (free_.empty()) {
    slot = static_cast<std::uint32_t>(rows_.size());
    rows_.emplace_back();
    bounds_.emplace_back();
    present_.push_back(0);
    resting_.push_back(1);
    layers_.push_back(0);
    states_.resize(states_.size() + state_bytes_);
  } else {
    slot = free_.back();
    free_.pop_back();
    rows_[slot] = {};
    std::fill_n(state(slot), state_bytes_, std::byte{0});
  }
  ObjectRow& row = rows_[slot];
  row.object = {slot, id.generation(), id.number(), spec.present ? messages::flag_present : 0u};
  row.pose = spec.pose;
  row.user_data = spec.user_data;
  row.shape = spec.shape;
  row.layer = spec.layer;
  layers_[slot] = static_cast<std::uint8_t>(spec.layer);
  row.category = static_cast<std::uint16_t>(spec.category);
  row.user = spec.user;
  row.alive = true;
  index_.set(id.number(), slot);
  mark_moved(slot);
  return slot;
}

void ObjectTable::end(std::uint32_t slot) {
  ObjectRow& row = rows_[slot];
  row.alive = false;
  row.object.flags = 0;
  index_.erase(row.object.number);
  ended_.push_back(slot);
  mark_moved(slot);
}

void ObjectTable::settle() {
  // What moved rests from the next frame on, unless it moves again: mark_moved clears the byte then.
  for (const std::uint32_t slot : moved_) {
    rows_[slot].moved = false;
    rows_[slot].reported_by_node = false;
    resting_[slot] = 1;
  }
  moved_.clear();
  free_.insert(free_.end(), ended_.begin(), ended_.end());
  ended_.clear();
}

void ObjectTable::mark_moved(std::uint32_t slot) {
  ObjectRow& row = rows_[slot];
  present_[slot] = (row.object.flags & messages::flag_present) != 0 ? 1 : 0;
  resting_[slot] = 0;
  if (!row.moved) {
    row.moved = true;
    moved_.push_back(slot);
  }
}

}  // namespace ringfence::nodes
