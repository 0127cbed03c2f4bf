#include "gateway/clients/known_objects.hpp"

#include <algorithm>

namespace ringfence::gateway {

bool KnownObjects::contains(ObjectNumber number) const noexcept {
  const auto found = std::ranges::lower_bound(entries_, number, {}, &Entry::number);
  return found != entries_.end() && found->number == number && !found->is_removed;
}

void KnownObjects::add_object(const SharedObject& object, Stamp since, Stamp acknowledged, Update& update) {
  if (std::max(since, object.changed) > acknowledged) {
    update.entered.push_back({.number = object.number,
                              .generation = object.generation,
                              .shape = object.shape,
                              .category = object.category,
                              .user = object.user,
                              .position = object.position,
                              .turn = object.turn,
                              .metadata = {}});
    return;
  }
  const bool has_turned = object.turned > acknowledged;
  if (object.moved > acknowledged || has_turned) {
    update.moved.push_back(
        {.number = object.number, .has_turn = has_turned, .turn = object.turn, .position = object.position});
  }
}

void KnownObjects::add_changes(std::span<const std::uint32_t> near, const ObjectTable& table, Stamp now,
                               Stamp acknowledged, Update& update) {
  static thread_local std::vector<Entry> next;  // shared, so that a client keeps only what it has
  next.clear();
  auto known = entries_.cbegin();
  const auto remove_up_to = [&](std::uint64_t number) {
    for (; known != entries_.cend() && known->number < number; ++known) {
      const Entry entry = known->is_removed ? *known : Entry{known->number, true, now};
      if (entry.since <= acknowledged) continue;
      update.removed.push_back(entry.number);
      next.push_back(entry);
    }
  };
  for (const std::uint32_t index : near) {
    const SharedObject& object = table[index];
    remove_up_to(object.number);
    Entry entry{object.number, false, now};
    if (known != entries_.cend() && known->number == object.number) {
      if (!known->is_removed) entry = *known;
      ++known;
    }
    add_object(object, entry.since, acknowledged, update);
    next.push_back(entry);
  }
  remove_up_to(std::uint64_t{1} << 32);
  entries_.assign(next.begin(), next.end());
}

}  // namespace ringfence::gateway
