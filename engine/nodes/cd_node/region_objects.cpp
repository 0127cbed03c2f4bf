#include "nodes/cd_node/region_objects.hpp"

#include <algorithm>

namespace ringfence::nodes {

RegionObjects::RegionObjects(std::size_t objects, bool sweeps) : sweeps_(sweeps) {
  index_.reserve(objects);
  slots_.reserve(objects);
  bodies_.reserve(objects);
  numbers_.reserve(objects);
  hosted_.reserve(objects);
  marks_.reserve(objects);
  marks_before_.reserve(objects);
  layers_.reserve(objects);
  if (sweeps_) {
    bounds_.reserve(objects);
    groups_.reserve(objects);
    resting_.reserve(objects);
    present_.reserve(objects);
  }
}

// Adds an entry. The caller sets its values.
std::uint32_t RegionObjects::add(std::uint32_t slot) {
  if (slot >= index_.size()) {
    index_.resize(std::max<std::size_t>(slot + 1, index_.capacity()), none);
  }
  const std::uint32_t i = index_[slot] = static_cast<std::uint32_t>(slots_.size());
  slots_.push_back(slot);
  bodies_.add().number = 0;  // not the number of any object, so set() writes the constant fields
  numbers_.add();
  hosted_.add();
  marks_.push_back(0);
  marks_before_.push_back(0);
  layers_.push_back(0);
  if (sweeps_) {
    bounds_.add();
    groups_.push_back(0);
    resting_.push_back(0);
    present_.push_back(1);
  }
  return i;
}

void RegionObjects::set_filter(std::uint32_t i, PairFilter filter) {
  layers_[i] = filter.layer;
  if (sweeps_) {
    groups_[i] = filter.group;
    has_groups_ |= filter.group != 0;
  }
}

void RegionObjects::remove(std::uint32_t slot) {
  const std::uint32_t i = find(slot);
  if (i == none) {
    return;
  }
  const std::size_t last = slots_.size() - 1;
  if (i != last) {
    slots_[i] = slots_[last];
    bodies_[i] = bodies_[last];
    numbers_[i] = numbers_[last];
    hosted_[i] = hosted_[last];
    marks_[i] = marks_[last];
    marks_before_[i] = marks_before_[last];
    layers_[i] = layers_[last];
    if (sweeps_) {
      bounds_[i] = bounds_[last];
      groups_[i] = groups_[last];
      resting_[i] = 0;
    }
    index_[slots_[i]] = i;
  }
  slots_.pop_back();
  bodies_.pop_back();
  numbers_.pop_back();
  hosted_.pop_back();
  marks_.pop_back();
  marks_before_.pop_back();
  layers_.pop_back();
  if (sweeps_) {
    bounds_.pop_back();
    groups_.pop_back();
    resting_.pop_back();
    present_.pop_back();
  }
  index_[slot] = none;
}

void RegionObjects::clear() noexcept {
  for (const std::uint32_t slot : slots_) {
    index_[slot] = none;
  }
  slots_.clear();
  bodies_.clear();
  bounds_.clear();
  layers_.clear();
  groups_.clear();
  numbers_.clear();
  hosted_.clear();
  marks_.clear();
  marks_before_.clear();
  resting_.clear();
  present_.clear();
}

void RegionObjects::settle() noexcept { std::fill(resting_.begin(), resting_.end(), std::uint8_t{1}); }

}  // namespace ringfence::nodes
