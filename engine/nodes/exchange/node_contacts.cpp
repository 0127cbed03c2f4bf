#include "nodes/exchange/node_contacts.hpp"

#include <algorithm>
#include <utility>

#include "base/prefetch.hpp"
#include "base/renumbering.hpp"

namespace ringfence::nodes {
namespace {

/// Removes the entries of a list at these positions, ascending.
template <class T>
void remove(base::FlatList<T>& list, std::span<const std::uint32_t> positions) {
  std::size_t kept = positions.front();
  std::size_t next = 0;
  for (std::size_t i = kept; i < list.size(); ++i) {
    if (next < positions.size() && positions[next] == i) {
      ++next;
    } else {
      list[kept++] = list[i];
    }
  }
  list.resize(kept);
}

/// Entries of a list hold ascending positions, `position(entry)`, in another list, from which entries were removed at
/// the positions `removed`. Removes those whose entry was removed, and changes the others accordingly.
template <class T, class Position>
void renumber(base::FlatList<T>& list, std::span<const std::uint32_t> removed, Position position) {
  base::Renumbering place(removed);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::uint32_t now = place(position(list[i]));
    if (now != base::Renumbering::gone) {
      list[kept] = list[i];
      position(list[kept++]) = now;
    }
  }
  list.resize(kept);
}

}  // namespace

void NodeContacts::start(std::uint64_t new_frame) {
  if (frame != new_frame) {
    std::swap(keys, keys_before);
    std::swap(found, found_before);
    std::swap(user_contacts, user_contacts_before);
    frame_before = std::exchange(frame, new_frame);
  }
  keys.clear();
  found.clear();
  begun.clear();
  beginning.clear();
  border_beginning.clear();
  ending.clear();
  ending_at.clear();
  border_ending.clear();
  user_contacts.clear();
  user_contacts_ending.clear();
  for_peers.clear();
  summarize();
}

// Most contacts persist, so equal keys are skipped in runs. The entries of ended contacts are not in the cache; they
// are prefetched here and read later.
void NodeContacts::compare_keys() {
  begun.resize(keys.size());
  std::fill(begun.begin(), begun.end(), std::uint8_t{0});
  const std::uint64_t* const now = keys.data();
  const std::uint64_t* const before = keys_before.data();
  const auto count = static_cast<std::uint32_t>(keys.size());
  const auto olds = static_cast<std::uint32_t>(keys_before.size());
  std::uint32_t i = 0;
  std::uint32_t old = 0;
  std::size_t next = 0;
  for (;;) {
    while (i < count && old < olds && now[i] == before[old]) {
      ++i;
      ++old;
    }
    if (old < olds && (i == count || before[old] < now[i])) {
      const std::uint64_t key = before[old];
      base::prefetch_for_read(&found_before[old]);
      ending.push_back(key);
      ending_at.push_back(old);
      while (next < user_contacts_before.size() && user_contacts_before[next].key < key) {
        ++next;
      }
      if (next < user_contacts_before.size() && user_contacts_before[next].key == key) {
        user_contacts_ending.push_back(user_contacts_before[next]);
      }
      ++old;
    } else if (i < count) {
      begun[i] = 1;
      beginning.push_back(i);
      ++i;
    } else {
      break;
    }
  }
}

void NodeContacts::unlist(std::span<const std::uint32_t> positions) {
  if (positions.empty()) {
    return;
  }
  end_unlisted(positions);
  remove(keys, positions);
  remove(found, positions);
  remove(begun, positions);
  renumber(beginning, positions, [](std::uint32_t& position) -> std::uint32_t& { return position; });
  renumber(border_beginning, positions, [](BorderContact& contact) -> std::uint32_t& { return contact.position; });
  renumber(user_contacts, positions, [](UserContact& contact) -> std::uint32_t& { return contact.position; });
  for_peers.renumber(positions);
  summarize();
}

// A contact that persists is in keys_before. The node found it, so no other node did: it ends here, not at a border.
void NodeContacts::end_unlisted(std::span<const std::uint32_t> positions) {
  const auto persists = [this](std::uint32_t position) { return begun[position] == 0; };
  std::size_t next_user = 0;
  for (const std::uint32_t position : positions) {
    while (next_user < user_contacts.size() && user_contacts[next_user].position < position) {
      ++next_user;
    }
    const bool concerns_user = next_user < user_contacts.size() && user_contacts[next_user].position == position;
    if (concerns_user && persists(position)) {
      user_contacts_ending.push_back(user_contacts[next_user]);
    }
  }
  // Merges from the end, in place.
  std::size_t old = ending.size();
  ending.resize(old + static_cast<std::size_t>(std::count_if(positions.begin(), positions.end(), persists)));
  ending_at.clear();
  std::size_t to = ending.size();
  for (std::size_t i = positions.size(); i-- > 0;) {
    if (persists(positions[i])) {
      const std::uint64_t key = keys[positions[i]];
      for (; old > 0 && ending[old - 1] > key; --old) {
        ending[--to] = ending[old - 1];
      }
      ending[--to] = key;
    }
  }
}

}  // namespace ringfence::nodes
