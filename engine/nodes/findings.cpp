#include "nodes/findings.hpp"

#include <algorithm>
#include <utility>

namespace ringfence::nodes {

void Findings::start(std::uint64_t new_frame) {
  if (frame != new_frame) {
    std::swap(keys, keys_before);
    std::swap(outer, outer_before);
    frame_before = std::exchange(frame, new_frame);
  }
  keys.clear();
  found.clear();
  beginning.clear();
  beginning_at.clear();
  ending.clear();
  outer.clear();
  outer_ending.clear();
  for_peers.clear();
}

void Findings::compare() {
  std::size_t old = 0;
  const std::size_t olds = keys_before.size();
  std::size_t next = 0;
  const auto end = [&] {
    const std::uint64_t key = keys_before[old];
    ending.push_back(key);
    while (next < outer_before.size() && outer_before[next].key < key) {
      ++next;
    }
    if (next < outer_before.size() && outer_before[next].key == key) {
      outer_ending.push_back(outer_before[next]);
    }
  };
  for (std::uint32_t i = 0; i < keys.size(); ++i) {
    const std::uint64_t key = keys[i];
    for (; old < olds && keys_before[old] < key; ++old) {
      end();
    }
    if (old < olds && keys_before[old] == key) {
      ++old;
    } else {
      beginning.push_back(key);
      beginning_at.push_back(i);
    }
  }
  for (; old < olds; ++old) {
    end();
  }
}

bool Findings::begins(std::uint32_t position) const noexcept {
  return std::binary_search(begun.begin(), begun.end(), position);
}

}  // namespace ringfence::nodes
