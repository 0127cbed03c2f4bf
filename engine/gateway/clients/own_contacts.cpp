#include "gateway/clients/own_contacts.hpp"

#include <algorithm>
#include <cmath>

namespace ringfence::gateway {

void OwnContacts::add_standing(const Contact& contact, ObjectNumber avatar, const Entry& entry, Stamp now,
                               Update& update) {
  const bool is_a = contact.a == avatar;
  const Vec3f normal = is_a ? contact.normal : Vec3f{-contact.normal.x, -contact.normal.y, -contact.normal.z};
  update.contacts.push_back({.other = entry.other,
                             .phase = entry.began == now ? Phase::begin : Phase::persist,
                             .age = now - entry.began,
                             .normal = quantise_normal(normal),
                             .depth = static_cast<std::uint64_t>(std::nearbyint(contact.depth / quantum)),
                             .point = quantise(contact.point)});
}

void OwnContacts::add_contacts(std::span<const Contact> contacts, ObjectNumber avatar, Stamp now, Stamp acknowledged,
                               Update& update) {
  static thread_local std::vector<Entry> next;  // shared, so that a client keeps only what it has
  next.clear();
  auto known = entries_.cbegin();
  const auto end_up_to = [&](std::uint64_t other) {
    for (; known != entries_.cend() && known->other < other; ++known) {
      Entry entry = *known;
      if (entry.ended == 0) entry.ended = now;
      if (entry.ended <= acknowledged) continue;
      update.contacts.push_back(
          {.other = entry.other, .phase = Phase::end, .age = now - entry.ended, .normal = {}, .depth = 0, .point = {}});
      next.push_back(entry);
    }
  };
  // The contacts are in order of (a, b), and the avatar is in each: so they are in order of the other object.
  for (const Contact& contact : contacts) {
    if (contact.phase == Phase::end || (contact.a != avatar && contact.b != avatar)) continue;
    const ObjectNumber other = contact.a == avatar ? contact.b : contact.a;
    end_up_to(other);
    Entry entry{other, contact.phase == Phase::begin ? now : now - 1, 0};
    if (known != entries_.cend() && known->other == other) {
      if (known->ended == 0 && contact.phase == Phase::persist) entry.began = known->began;
      ++known;
    }
    add_standing(contact, avatar, entry, now, update);
    next.push_back(entry);
  }
  end_up_to(std::uint64_t{1} << 32);
  entries_.assign(next.begin(), next.end());
  limit_ended();
}

void OwnContacts::limit_ended() {
  const auto is_ended = [](const Entry& entry) { return entry.ended != 0; };
  auto excess = static_cast<std::size_t>(std::ranges::count_if(entries_, is_ended));
  if (excess <= max_ended) return;
  std::vector<Stamp> ends;
  for (const Entry& entry : entries_) {
    if (is_ended(entry)) ends.push_back(entry.ended);
  }
  std::ranges::nth_element(ends, ends.begin() + static_cast<std::ptrdiff_t>(excess - max_ended));
  const Stamp oldest_kept = ends[excess - max_ended];
  std::erase_if(entries_, [&](const Entry& entry) { return is_ended(entry) && entry.ended < oldest_kept; });
}

}  // namespace ringfence::gateway
