#include "nodes/known_objects.hpp"

#include <algorithm>

namespace ringfence::nodes {

KnownObjects::KnownObjects(std::size_t objects, bool sweeps) : sweeps_(sweeps) {
  index_.reserve(objects);
  slots_.reserve(objects);
  bodies_.reserve(objects);
  next_hosts_.reserve(objects);
  numbers_.reserve(objects);
  inner_.reserve(objects);
  was_inner_.reserve(objects);
  if (sweeps_) {
    bounds_.reserve(objects);
    layers_.reserve(objects);
    resting_.reserve(objects);
    present_.reserve(objects);
  }
}

// Of what it holds nothing is set yet.
std::uint32_t KnownObjects::add(std::uint32_t slot) {
  if (slot >= index_.size()) {
    index_.resize(std::max<std::size_t>(slot + 1, index_.capacity()), none);
  }
  const std::uint32_t i = index_[slot] = static_cast<std::uint32_t>(slots_.size());
  slots_.push_back(slot);
  bodies_.add();
  next_hosts_.push_back(NextHost::nobody);
  numbers_.add();
  inner_.push_back(0);
  was_inner_.push_back(0);
  if (sweeps_) {
    bounds_.add();
    layers_.push_back(0);
    resting_.push_back(0);
    present_.push_back(1);
  }
  return i;
}

void KnownObjects::forget(std::uint32_t slot) {
  const std::uint32_t i = find(slot);
  if (i == none) {
    return;
  }
  const std::size_t last = slots_.size() - 1;
  if (i != last) {
    slots_[i] = slots_[last];
    bodies_[i] = bodies_[last];
    next_hosts_[i] = next_hosts_[last];
    numbers_[i] = numbers_[last];
    inner_[i] = inner_[last];
    was_inner_[i] = was_inner_[last];
    if (sweeps_) {
      bounds_[i] = bounds_[last];
      layers_[i] = layers_[last];
      resting_[i] = 0;
    }
    index_[slots_[i]] = i;
  }
  slots_.pop_back();
  bodies_.pop_back();
  next_hosts_.pop_back();
  numbers_.pop_back();
  inner_.pop_back();
  was_inner_.pop_back();
  if (sweeps_) {
    bounds_.pop_back();
    layers_.pop_back();
    resting_.pop_back();
    present_.pop_back();
  }
  index_[slot] = none;
}

void KnownObjects::clear() noexcept {
  for (const std::uint32_t slot : slots_) {
    index_[slot] = none;
  }
  slots_.clear();
  bodies_.clear();
  bounds_.clear();
  layers_.clear();
  next_hosts_.clear();
  numbers_.clear();
  inner_.clear();
  was_inner_.clear();
  resting_.clear();
  present_.clear();
}

void KnownObjects::settle() noexcept { std::fill(resting_.begin(), resting_.end(), std::uint8_t{1}); }

}  // namespace ringfence::nodes
