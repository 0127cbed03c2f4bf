#include "nodes/cd_node/region_objects.hpp"

#include <algorithm>

namespace ringfence::nodes {

RegionObjects::RegionObjects(std::size_t objects, bool sweeps) : sweeps_(sweeps) {
  each_list([&](auto& list) { list.reserve(objects); });
  groups_.reserve(objects);
  crowds_.reserve(objects);
}

// Calls visit for each list that has an element for each object. Groups and crowds have none until an object has one.
template <class Visit>
void RegionObjects::each_list(Visit visit) {
  visit(slots_), visit(bodies_), visit(numbers_), visit(changed_), visit(hosted_), visit(marks_), visit(marks_before_),
      visit(layers_);
  if (has_groups_) {
    visit(groups_);
  }
  if (has_crowds_) {
    visit(crowds_);
  }
  if (sweeps_) {
    visit(bounds_), visit(resting_), visit(present_);
  }
}

// Adds an entry. The caller sets its values.
std::uint32_t RegionObjects::add(std::uint32_t slot) {
  const auto i = static_cast<std::uint32_t>(slots_.size());
  index_.set(slot + 1, i);
  slots_.push_back(slot);
  bodies_.add().number = 0;  // not the number of any object, so set() writes the constant fields
  numbers_.add();
  changed_.push_back(frame_);
  hosted_.add();
  marks_.push_back(0);
  marks_before_.push_back(0);
  layers_.push_back(0);
  groups_.resize(has_groups_ ? slots_.size() : 0);
  crowds_.resize(has_crowds_ ? slots_.size() : 0);
  if (sweeps_) {
    bounds_.add();
    resting_.push_back(0);
    present_.push_back(1);
  }
  return i;
}

void RegionObjects::set_filter(std::uint32_t i, PairFilter filter) {
  layers_[i] = filter.layer;
  changed_[i] = frame_;
  const auto set = [&](std::vector<std::uint32_t>& list, bool& has_any, std::uint32_t value) {
    if (value != 0 && !has_any) {
      list.resize(slots_.size());
      has_any = true;
    }
    if (has_any) {
      list[i] = value;
    }
  };
  set(groups_, has_groups_, filter.group);
  set(crowds_, has_crowds_, filter.crowd);
}

void RegionObjects::remove(std::uint32_t slot) {
  const std::uint32_t i = find(slot);
  if (i == none) {
    return;
  }
  const std::size_t last = slots_.size() - 1;
  index_.set(slots_[last] + 1, i);
  each_list([&](auto& list) {
    list[i] = list[last];
    list.pop_back();
  });
  if (i != last) {
    changed_[i] = frame_;
  }
  if (sweeps_ && i != last) {
    resting_[i] = 0;
  }
  index_.erase(slot + 1);
}

void RegionObjects::clear() noexcept {
  for (const std::uint32_t slot : slots_) {
    index_.erase(slot + 1);
  }
  each_list([](auto& list) { list.clear(); });
}

void RegionObjects::settle() noexcept { std::fill(resting_.begin(), resting_.end(), std::uint8_t{1}); }

}  // namespace ringfence::nodes
