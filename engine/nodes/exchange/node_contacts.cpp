#include "nodes/exchange/node_contacts.hpp"

#include <algorithm>
#include <utility>

#include "base/prefetch.hpp"

namespace ringfence::nodes {

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

}  // namespace ringfence::nodes
